#!/bin/sh
# demo.sh   what `make demo` runs, from the checkout's root: build the demo organ's bank; press it, with device, controller and
# host on one bus, while the page shows it; print what came out beside an independent finite-element solve.
#
# SCENE=name    another scene of host/scenes/demo (default demo), or the path of a scene file
# GESTURE=name  the hand's gesture (default: the built-in one with the scene's name, or tour; the second instrument's: the
#               built-in one with the scene's name and -second, or press)
# PORT=number   of the page
# HOLD=1        the page stays up afterwards, until Ctrl-C
# Everything is written to $B/demo.
set -eu
build=${B:-build}
scene=${SCENE:-demo}
case $scene in
*/* | *.yaml) file=$scene ;;
*) file=host/scenes/demo/$scene.yaml ;;
esac
if [ ! -f "$file" ]; then
    known=$(for known in host/scenes/demo/*.yaml; do basename "$known" .yaml; done | tr '\n' ' ')
    echo "demo: there is no scene $file; SCENE can be a path or one of: $known" >&2
    exit 2
fi
name=$(basename "$file" .yaml)
out=$build/demo
gesture=${GESTURE:-tour}
[ -n "${GESTURE-}" ] || ! "$build/trocar" run --print-gesture "$name" >/dev/null 2>&1 || gesture=$name
second=
[ -n "${GESTURE-}" ] || ! "$build/trocar" run --print-gesture "$name-second" >/dev/null 2>&1 || second=$name-second
mkdir -p "$out"

# The first value behind "KEY" in a file with one JSON object.
value()
{
    tr ',{}' '\n\n\n' <"$1" | sed -n 's/^ *"'"$2"'" *: *"\{0,1\}\([^"]*[^" ]\).*/\1/p' | head -n 1
}

# The objects of the list "instruments", one a line.
instruments()
{
    tr '{' '\n' <"$1" | sed -n '/^ *"name"/p'
}

row()
{
    printf '  %-36s %s\n' "$1" "$2"
}

number()
{
    awk -v format="$1" -v value="$2" 'BEGIN { printf format, value }'
}

# Reads the line of JSON that the run prints when it is over; with HOLD the page is still up then.
table()
{
    trap '' INT # Ctrl-C is for the run; its end is the end of the line here
    IFS= read -r line || return 1
    printf '%s\n' "$line" >"$out/$name.run.json"
    b=$out/$name.build.json
    r=$out/$name.run.json
    echo
    row "nodes" "$(value "$b" nodes)"
    row "tetrahedra" "$(value "$b" elements)"
    row "surface nodes" "$(value "$b" surface_nodes)"
    row "bank" "$(value "$b" bytes) bytes"
    row "built in" "$(number '%.2f s' "$(value "$b" seconds)")"
    row "ticks of 1 ms" "$(value "$r" ticks)"
    row "missed ticks" "$(value "$r" missed)"
    row "peak force" "$(number '%.3f N' "$(value "$r" peak_force_N)")"
    if [ "$(instruments "$r" | wc -l)" -gt 1 ]; then
        instruments "$r" | while IFS= read -r one; do
            printf '%s\n' "$one" >"$out/$name.one.json"
            o=$out/$name.one.json
            force=$(number '%.3f N' "$(value "$o" peak_force_N)")
            other=$(value "$o" from_other_N)
            row "  of instrument $(value "$o" name)" "$force${other:+; at most $(number '%.3f N' "$other") because of the other one}"
        done
    fi
    error=$(value "$r" force_error_vs_fem)
    case $error in
    '' | null) row "controller against finite elements" "not compared: $(value "$r" fem_reason)" ;;
    *) row "controller against finite elements" "$(number '%.2e' "$error") of the peak force, at worst" ;;
    esac
    echo
}

echo "The bank of $file:"
"$build/trocar" build "$file" -o "$out/$name.bank" --json >"$out/$name.build.json"
echo "Device, controller and host:"
trap : INT # whoever ends HOLD with Ctrl-C still gets the table and the status
echo 1 >"$out/status"
{
    status=0
    "$build/trocar" run "$file" --bank "$out/$name.bank" --gesture "$gesture" ${second:+--gesture "$second"} --torque-log "$out/$name.log" \
        --view ${PORT:+--port "$PORT"} ${HOLD:+--hold} --json || status=$?
    echo $status >"$out/status"
} | table || [ "$(cat "$out/status")" -ne 0 ] || exit 1
exit "$(cat "$out/status")"
