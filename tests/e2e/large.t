#!/bin/sh
# Large displacements from the outside: a compression in, a bank with its curves, a drawing; numbers of a neo-Hookean body in a bank;
# runs that say what they compare; and refusals in one line.
. tests/refused.sh

# A run of bank $1 whose linear force is that of linear finite elements, which says so, and whose force is another.
run()
{
    "$build/trocar" run "$1" --json >"$work/out" 2>"$work/err" && python3 - "$work/out" <<'END'
import json, sys
j = json.load(open(sys.argv[1]))
sys.exit(not (j["force_error_vs_fem"] < 1e-4 and "before it is corrected" in j["fem_reference"] and j["correction_N"] > 0.005 * j["peak_force_N"]))
END
}

echo 1..11
cp host/scenes/demo/compression.csv "$work/curve.csv"
effects_scene '{quasi_nonlinear: {fit: curve.csv, height: 13 mm, radius: 15 mm, E: 3 kPa, nu: 0.45}}' >"$work/fit.yaml"
"$build/trocar" build "$work/fit.yaml" --plain -o "$work/fit.bank" >"$work/out" 2>"$work/err"
result $? "a scene that names a compression builds"
grep -q 'Q, force: degree 4, monotone up to 0.6362 N; residuals 0.0' "$work/err" && grep -q 'P, across: degree 4' "$work/err" &&
    grep -q 'drawn in' "$work/err"
result $? "and says degree, range and residuals of its curves"
grep -q '</svg>' "$work/fit.bank.quasi_nonlinear.svg" && [ "$(grep -c 'class="mark"' "$work/fit.bank.quasi_nonlinear.svg")" = 20 ]
result $? "and draws every value beside the curves"
rm "$work/curve.csv"
run "$work/fit.bank"
result $? "a run of it, without the table, compares the linear force and says so"
effects_scene '{neo_hookean: {sites: 40, radius: 8 mm}}' >"$work/neo.yaml"
"$build/trocar" build "$work/neo.yaml" --plain -o "$work/neo.bank" >"$work/out" 2>"$work/err" &&
    "$build/trocar" info "$work/neo.bank" | grep -q 'effects: neo_hookean'
result $? "a neo-Hookean body builds from finite elements alone"
run "$work/neo.bank"
result $? "a run of it compares the linear force and says so"
effects_refused 5 'quasi_nonlinear and neo_hookean do not go together' \
    '{neo_hookean: {}, quasi_nonlinear: {Q: {range: 1 N, coefficients: [1]}}}' "both corrections"
effects_refused 5 'Q is not monotone: it turns at 0.8333' '{quasi_nonlinear: {Q: {range: 1 N, coefficients: [1, -0.6]}}}' "a curve that turns"
effects_refused 5 'needs either a table to fit, or the curve Q' '{quasi_nonlinear: {height: 1 mm}}' "no curve"
effects_refused 5 'sites = 3' '{neo_hookean: {sites: 3}}' "too few sites"
effects_refused 3 'none.csv' '{quasi_nonlinear: {fit: none.csv, height: 1 cm, radius: 1 cm}}' "a compression that is not there"
