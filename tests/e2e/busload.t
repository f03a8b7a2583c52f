#!/bin/sh
# trocar busload: the table, the object, two instruments below 70 %, a slow bus refused.
trocar=${B:-build}/trocar
scene=host/scenes/demo/demo.yaml
folder=$(mktemp -d) || exit 1
trap 'rm -rf "$folder"' EXIT
echo 1..5
fault=0
check() {
    if [ "$1" -eq 0 ]; then echo "ok $2 - $3"; else echo "not ok $2 - $3"; fault=1; fi
}
"$trocar" busload "$scene" --fd >"$folder/table" && grep -q '^Torques *0x200+n controller *1000\.0 *135 *13\.50 %' "$folder/table"
check $? 1 "the table has a line per frame"
"$trocar" busload "$scene" --instruments 2 --fd --json >"$folder/two.json" &&
    python3 - "$folder/two.json" <<'END'
import json, sys
load = json.load(open(sys.argv[1]))
assert load["instruments"] == 2 and 0.6 < load["share"] <= 0.70 and load["fd_share"] < load["share"]
assert abs(sum(frame["share"] for frame in load["frames"]) - load["share"]) < 1e-9
assert load["fullest_tick_us"] < 1000
END
check $? 2 "two instruments with all telemetry take at most 70 %; the object adds up"
"$trocar" busload "$scene" --bit-rate 500000 >"$folder/table" 2>"$folder/message"
[ $? -eq 12 ] && grep -q '500000\|88.9 %' "$folder/message" && grep -q '^all ' "$folder/table"
check $? 3 "a bus at half the rate is refused with exit code 12, after its table"
"$trocar" busload nowhere.yaml 2>"$folder/message"
[ $? -eq 3 ] && [ "$(wc -l <"$folder/message")" -eq 1 ]
check $? 4 "a scene that is not there ends with exit code 3 and one line"
"$trocar" busload "$scene" --instruments 3 2>"$folder/message"
[ $? -eq 2 ] && grep -q -- '--instruments takes a whole number from 1 to 2' "$folder/message"
check $? 5 "three instruments are refused"
exit $fault
