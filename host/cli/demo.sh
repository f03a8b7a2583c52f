#!/bin/sh
# demo.sh   what `make demo` runs, from the checkout's root: build the demo organ's bank, press it with device, controller and
# host on one bus while the page shows it, and print what came out beside an independent finite-element solve.
#
# SCENE=name   another scene of host/scenes/demo (default demo), or a path to a scene file
# GESTURE=name the hand's gesture (default tour)
# HOLD=1       the page stays up afterwards, until Ctrl-C
# Everything is written to $B/demo.
set -eu
build=${B:-build}
scene=${SCENE:-demo}
case $scene in
*/* | *.yaml) file=$scene ;;
*) file=host/scenes/demo/$scene.yaml ;;
esac
name=$(basename "$file" .yaml)
if [ ! -f "$file" ]; then
    echo "demo: there is no scene $file; SCENE can be: $(cd host/scenes/demo && ls -- *.yaml | sed 's/\.yaml$//' | tr '\n' ' ')" >&2
    exit 2
fi
out=$build/demo
mkdir -p "$out"

echo "Building the bank of $file"
"$build/trocar" build "$file" -o "$out/$name.bank" --json >"$out/$name.build.json"
echo "Running device, controller and host"
"$build/trocar" run "$file" --bank "$out/$name.bank" --gesture "${GESTURE:-tour}" --torque-log "$out/$name.log" \
    --view ${HOLD:+--hold} --json >"$out/$name.run.json"

# The first number or word behind "KEY": in a JSON file.
value()
{
    tr ',{' '\n\n' <"$out/$name.$1.json" | sed -n 's/^[[:space:]]*"'"$2"'"[[:space:]]*:[[:space:]]*"\{0,1\}\([^"}]*[^"}[:space:]]\).*/\1/p' |
        head -n 1
}
row()
{
    printf '  %-34s %s\n' "$1" "$2"
}
echo
row "nodes" "$(value build nodes)"
row "tetrahedra" "$(value build elements)"
row "surface nodes" "$(value build surface_nodes)"
row "bank" "$(value build bytes) bytes"
row "built in" "$(value build seconds) s"
row "ticks (1 ms each)" "$(value run ticks)"
row "missed ticks" "$(value run missed)"
row "peak force" "$(value run peak_force_N) N"
row "controller force vs finite elements" "$(value run force_error_vs_fem) of the peak"
