#!/bin/sh
# What `make demo` runs, with each of the demo's scenes, ends with the table, and every figure in it is there and plausible.
set -u
build=${B:-build}
place=$(mktemp -d) || exit 1
trap 'rm -rf "$place"' EXIT
failed=0 count=0

result()
{
    count=$((count + 1))
    if [ "$1" -eq 0 ]; then
        echo "ok $count - $2"
    else
        echo "not ok $count - $2"
        sed 's/^/# /' "$place/out" "$place/err"
        failed=1
    fi
}

# The number of a row of the table.
figure()
{
    sed -n "s/^  $1  *\([0-9.e+-]*\).*/\1/p" "$place/out"
}

within() # NAME OF THE ROW, LEAST, MOST
{
    awk -v value="$(figure "$1")" -v least="$2" -v most="$3" \
        'BEGIN { exit !(value != "" && value + 0 >= least && value + 0 <= most) }'
}

# The controller's force is that of the finite elements to within what the bank's compression was measured to cost at most, when
# it was built; KEY says for which contacts.
agrees() # SCENE, KEY
{
    bound=$(sed -n 's/.*"'"$2"'": {[^}]*"max": \([0-9.e-]*\).*/\1/p' "$build/demo/$1.build.json")
    within "controller against finite elements" 0 "${bound:-0}"
}

echo 1..11
B=$build PORT=0 GESTURE=press host/cli/demo.sh >"$place/out" 2>"$place/err" </dev/null
result $? "the demo succeeds without a browser"
grep -q 'http://127\.0\.0\.1:[0-9]' "$place/out" "$place/err"
result $? "it prints the page's address"
within nodes 100 1e6 && within tetrahedra 100 1e7 && within "surface nodes" 100 65534 && within bank 1000 1e9 && within "built in" 0.001 600
result $? "the table says how large the body and its bank are"
within "ticks of 1 ms" 500 1e6 && within "missed ticks" 0 0
result $? "it says how many ticks ran, and none was missed"
within "peak force" 0.01 100
result $? "the hand felt a force"
agrees demo force_error
result $? "the controller's force is that of the finite elements within the bank's stated error, $bound"

B=$build PORT=0 SCENE=grasp host/cli/demo.sh >"$place/out" 2>"$place/err" </dev/null
result $? "the jaws' demo succeeds"
within "ticks of 1 ms" 3000 1e6 && within "missed ticks" 0 0 && within "peak force" 0.1 100
result $? "it closes and opens the jaws, and the hand feels it"

B=$build PORT=0 SCENE=two_tools host/cli/demo.sh >"$place/out" 2>"$place/err" </dev/null
result $? "the demo of two instruments succeeds"
within "ticks of 1 ms" 5000 1e6 && within "missed ticks" 0 0 && within "  of instrument right" 0.1 100 && within "  of instrument left" 0.1 100 &&
    [ "$(figure "  of instrument right")" != "$(figure "  of instrument left")" ] &&
    [ "$(sed -n 's/.*at most \(0\.[0-9]*[1-9][0-9]*\) N because of the other one$/\1/p' "$place/out" | wc -l)" -eq 2 ]
result $? "each hand feels a force of its own, and a part of it is the other's doing"
agrees two_tools two
result $? "both forces are those of the finite elements within what the bank states for two contacts, $bound"
exit $failed
