#!/bin/sh
# Scenes from the outside: a bad one ends in one line that names file, line and remedy, in exit code 5, and writes nothing;
# the demo's scenes build, with surfaces of the size that keeps the demo quick.
. tests/refused.sh

# The block's scene with the sed edit $3.
bad()
{
    block_scene "$3" >"$work/bad.yaml"
    refused "$1" "$2" "$4"
}

builds()
{
    "$build/trocar" build "host/scenes/demo/$1.yaml" --json --quiet -o "$work/$1.bank" >"$work/out" 2>"$work/err"
    status=$?
    count=$(tr ',{}' '\n\n\n' <"$work/out" | sed -n 's/^ *"surface_nodes" *: *\([0-9]*\)$/\1/p')
    [ "$status" = 0 ] && [ "${count:-0}" -ge 350 ] && [ "$count" -le 500 ]
    result $? "$1.yaml builds, with 350 to 500 surface nodes"
}

# The patch error of the bank of the scene $1, p95.
patch_error()
{
    "$build/trocar" build "$1" --json --quiet -o "$work/slide.bank" 2>"$work/err" | tr ',{}' '\n\n\n' |
        sed -n '/"force_error"/,$s/^ *"p95" *: *\([0-9.e-]*\)$/\1/p' | head -1
}

echo 1..14
bad 5 "bad.yaml:4: unknown key 'boddy'" 's/^body:/boddy:/' "an unknown key"
bad 5 "did you mean 'body'?" 's/^body:/boddy:/' "an unknown key brings the nearest one"
bad 5 'bad.yaml:7: E: 12 has no unit; a pressure is expected here (Pa, kPa, MPa, GPa)' 's/12 kPa/12/' "a missing unit"
bad 5 'bad.yaml:8: E = -2000 Pa' 's/E: 2 kPa/E: -2 kPa/' "a negative modulus"
bad 5 'bad.yaml:8: nu = 0.5' '8s/nu: 0.45/nu: 0.5/' "an incompressible material"
bad 5 'bad.yaml:12: box holds no node' '12s/0.10/3/g' "an empty selection"
bad 5 "bad.yaml:8: material for label 'fatt', but the mesh has only: " 's/label: fat/label: fatt/' "a material for no label"
bad 7 "elements with label 1 'muscle' have no material" '7d' "a label without a material"
bad 5 'this version offers: friction' '$a effects: {glue: {mu: 0.2}}' "an effect"
bad 5 "reaches no point of the body: the nearest is " '$a instruments: [{name: far, trocar: {at: [0.6, 0.5, 0.2], axis: [0, 0, -1]}}]' "a trocar from which nothing is in reach"
bad 5 "can come to 1.83 m from the origin" '$a instruments: [{name: far, trocar: {at: [1.6, 0, 0], axis: [0, 0, -1]}}]' "a tip beyond what the bus reports"
block_scene '' >"$work/block.yaml"
block_scene 's/^  fixed:/&\n    - {plane: {at: [0, 0, 0.03], normal: [0, 0, -1]}, along: [0, 1, 1]}/' >"$work/slide.yaml"
echo "$(patch_error "$work/block.yaml") $(patch_error "$work/slide.yaml")" >"$work/out"
awk '{exit !(NF == 2 && $1 > 0 && $2 > 0 && $2 < 2 * $1)}' "$work/out"
result $? "a body on an oblique plane, whose compliance is next to singular there, is stored as truly as without"
builds demo
builds block
