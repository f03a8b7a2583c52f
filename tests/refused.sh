# Scenes that are refused, from the outside; for tests in sh, which source it. $work: a folder of the test's own, which goes with it.
build=${B:-build}
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
test=0

# A line of TAP: exit status $1, claim $2.
result()
{
    test=$((test + 1))
    if [ "$1" = 0 ]; then
        echo "ok $test - $2"
    else
        echo "not ok $test - $2"
        cat "$work/out" "$work/err" | sed 's/^/# /'
    fi
}

# The demo's block with a sed edit.
block_scene()
{
    sed "s|block.geo|$PWD/host/scenes/demo/block.geo|; $1" host/scenes/demo/block.yaml
}

# The scene in $work/bad.yaml ends in exit code $1 and one line, which has $2, and writes no bank.
refused()
{
    "$build/trocar" build "$work/bad.yaml" --quiet -o "$work/bad.bank" >"$work/out" 2>"$work/err"
    status=$?
    [ "$status" = "$1" ] && [ "$(wc -l <"$work/err")" = 1 ] && grep -qF "$2" "$work/err" && [ ! -e "$work/bad.bank" ]
    result $? "$3"
}

# The demo's block with the effects $1.
effects_scene()
{
    block_scene '/^effects:/d'
    echo "effects: $1"
}

# The same with the effects $3 is refused: exit code $1, a line with $2; claim $4.
effects_refused()
{
    effects_scene "$3" >"$work/bad.yaml"
    refused "$1" "$2" "$4"
}
