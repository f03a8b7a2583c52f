#!/bin/sh
# Visco-elastic tissue from the outside: measurements in, a bank with the fitted branches, a drawing, a run that full finite
# elements agree with; and refusals in one line.
. tests/refused.sh

echo 1..10
# G' and G'' of 1 + 0.3 (0.02 s) + 0.8 (0.9 s), times 1300 Pa, to four digits
awk 'BEGIN {
    print "omega [rad/s], G'"'"' [Pa], G'"''"' [Pa]"
    for (i = 0; i < 30; i++) {
        w = 0.1 * exp(i / 29 * log(3000)); x = (w * 0.02) ^ 2; y = (w * 0.9) ^ 2
        printf "%.4g, %.4g, %.4g\n", w, 1300 * (1 + 0.3 * x / (1 + x) + 0.8 * y / (1 + y)), \
            1300 * (0.3 * sqrt(x) / (1 + x) + 0.8 * sqrt(y) / (1 + y))
    }
}' >"$work/rheometer.csv"
effects_scene '{viscoelastic: {fit: rheometer.csv}}' >"$work/fit.yaml"
"$build/trocar" build "$work/fit.yaml" --plain -o "$work/fit.bank" >"$work/out" 2>"$work/err"
result $? "a scene that names measurements builds"
grep -q '30 rows fitted by 2 branches' "$work/err" && grep -q 'residuals: 0.0' "$work/err" && grep -q 'drawn in' "$work/err"
result $? "and says how well they are fitted"
head -c 5 "$work/fit.bank.viscoelastic.svg" 2>/dev/null | grep -q '<svg ' && grep -q '</svg>' "$work/fit.bank.viscoelastic.svg" &&
    [ "$(grep -c 'class="mark"' "$work/fit.bank.viscoelastic.svg")" = 60 ]
result $? "and draws every value beside the curves"
"$build/trocar" info "$work/fit.bank" >"$work/out" 2>"$work/err" && grep -q 'effects: viscoelastic' "$work/out" &&
    grep -aqE 'prony: \[\[0\.(300|299)[0-9]*, (20\.0|19\.9)[0-9]* ms\], \[0\.(800|799)[0-9]*, (0\.90|0\.89)[0-9]* s\]\]' "$work/fit.bank"
result $? "the bank holds the branches themselves"
rm "$work/rheometer.csv"
"$build/trocar" run "$work/fit.bank" --json >"$work/out" 2>"$work/err" &&
    tr ',{}' '\n\n\n' <"$work/out" | awk -F: '/"force_error_vs_fem"/ {found = 1; bad = $2 + 0 > 1e-4 || $2 ~ /null/} END {exit !found || bad}'
result $? "a run of it, without the table, gives the forces of full finite elements to 1e-4"
effects_refused 5 'swing and viscoelastic do not go together' '{swing: {modes: 2}, viscoelastic: {viscosity: 20 ms}}' \
    "visco-elastic tissue that swings"
effects_refused 5 'has both prony and boltzmann' '{viscoelastic: {prony: [[0.3, 1 s]], boltzmann: {k1: 1 kPa, k2: 1 kPa, C: 1 Pa s}}}' \
    "two models"
effects_refused 5 'C: 3 has no unit; a viscosity is expected here (Pa s, kPa s)' '{viscoelastic: {kelvin_voigt: {k: 1 kPa, C: 3}}}' \
    "a viscosity without its unit"
effects_refused 5 'the time of a branch = 0 s' '{viscoelastic: {prony: [[0.3, 0 s]]}}' "a branch without a time"
effects_refused 3 'none.csv' '{viscoelastic: {fit: none.csv}}' "measurements that are not there"
