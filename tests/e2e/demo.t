#!/bin/sh
# What `make demo` runs ends with the table, and every figure in it is there and plausible.
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

echo 1..6
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
# what the bank's compression was measured to cost at most, when it was built
bound=$(sed -n 's/.*"force_error": {[^}]*"max": \([0-9.e-]*\).*/\1/p' "$build/demo/demo.build.json")
within "controller against finite elements" 0 "${bound:-0}"
result $? "the controller's force is that of the finite elements within the bank's stated error, $bound"
exit $failed
