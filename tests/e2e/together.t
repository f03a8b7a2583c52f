#!/bin/sh
# Effects that a scene names together: what the controller renders of them agrees with full finite elements that have them too.
. tests/refused.sh

scenes=host/scenes/demo
cp $scenes/liver.geo "$work"

# The demo's scene $1 with these effects, this gesture of each instrument, and at most this error.
agrees()
{
    sed "s/^effects:.*/effects: $2/; s/mesh: .*/mesh: {file: liver.geo, unit: m, size: 18 mm}/" $scenes/$1.yaml >"$work/s.yaml"
    "$build/trocar" run "$work/s.yaml" $3 --json >"$work/out" 2>"$work/err" &&
        tr ',{}' '\n\n\n' <"$work/out" | awk -F: -v most="$4" '
            /"force_error_vs_fem"/ {found = 1; bad = bad || $2 + 0 > most || $2 ~ /null/}
            /"peak_force_N"/ {peak = $2 + 0 > peak ? $2 + 0 : peak}
            /"force_error_vs_fem"/ {print "# " most ": " $2}
            END {exit !found || bad || peak < 0.05}'
    result $? "$1: $2"
}

echo 1..6
# 0.2 %: ten sweeps leave at most that (shared/effects/friction.md); the bank's rounding is 0.1 % of the peak
agrees grasp '{friction: {mu: 0.3}, grasp: {slip: 2 N}}' '-g grasp' 3e-3
agrees grasp '{friction: {mu: 0.3}, viscoelastic: {prony: [[0.5, 0.1 s]]}}' '-g slide' 3e-3
agrees grasp '{friction: {mu: 0.3}, grasp: {slip: 2 N}, viscoelastic: {prony: [[0.5, 0.1 s]]}}' '-g grasp' 3e-3
agrees two_tools '{friction: {mu: 0.3, sweeps: 20}}' '-g slide -g press' 3e-3 # 14 contacts: ten sweeps leave 0.6 %
agrees two_tools '{viscoelastic: {prony: [[0.5, 0.1 s]]}}' '-g press -g slide' 3e-3
agrees two_tools '{friction: {mu: 0.2}, grasp: {slip: 1 N}}' '-g grasp -g slide' 3e-3
