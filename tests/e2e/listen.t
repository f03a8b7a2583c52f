#!/bin/sh
# The tools that listen. record and replay: a simulated session as a candump log, whole and damaged, through the controller
# again; monitor; bridge.
trocar=${B:-build}/trocar
folder=$(mktemp -d) || exit 1
trap 'rm -rf "$folder"' EXIT
bank=$folder/block.bank
echo 1..19
fault=0
check() {
    if [ "$1" -eq 0 ]; then echo "ok $2 - $3"; else echo "not ok $2 - $3"; fault=1; sed 's/^/# /' "$folder/message"; fi
}
value() { # the whole number behind "KEY" in the object
    sed -n 's/.*"'"$1"'": \([0-9]*\).*/\1/p' "$folder/object"
}
"$trocar" build host/scenes/demo/block.yaml -o "$bank" 2>"$folder/message" >/dev/null || { cat "$folder/message"; exit 1; }

"$trocar" record "$bank" -g tour -o "$folder/tour.log" --json >"$folder/object" 2>"$folder/message" &&
    [ "$(value frames)" -eq "$(wc -l <"$folder/tour.log")" ] && [ "$(value bytes)" -eq "$(wc -c <"$folder/tour.log")" ]
check $? 1 "record writes a line per frame"
"$trocar" replay "$folder/tour.log" --bank "$bank" --json >"$folder/object" 2>"$folder/message" &&
    [ "$(value agreed)" -eq "$(value ticks)" ] && [ "$(value ticks)" -gt 6000 ] && [ "$(value differed)" -eq 0 ] &&
    [ "$(value hashes_agreed)" -gt 60 ]
check $? 2 "replay computes the same torque frame in every tick"
"$trocar" record "$bank" -g tour -o "$folder/again.log" 2>"$folder/message" && cmp "$folder/tour.log" "$folder/again.log"
check $? 3 "the same session gives the same recording"
"$trocar" run "$bank" -g tour --no-fem --torque-log "$folder/torques" >/dev/null 2>"$folder/message" &&
    grep ' 201#' "$folder/tour.log" | cmp - "$folder/torques"
check $? 4 "its torque frames are those of trocar run --torque-log"

# one count in one sample in contact
at=$(grep -n ' 181#' "$folder/tour.log" | sed -n 2000p | cut -d: -f1)
python3 - "$folder/tour.log" "$at" "$folder/one.log" <<'END'
import sys
lines = open(sys.argv[1]).read().split("\n")
at = int(sys.argv[2]) - 1
head, data = lines[at].split("#")
lines[at] = head + "#%02X" % (int(data[:2], 16) ^ 1) + data[2:]
open(sys.argv[3], "w").write("\n".join(lines))
END
"$trocar" replay "$folder/one.log" --bank "$bank" --json >"$folder/object" 2>"$folder/message"
[ $? -eq 12 ] && [ "$(value first_difference_line)" -gt "$at" ] && [ "$(value first_difference_line)" -lt $((at + 40)) ] &&
    grep -q "one.log:$(value first_difference_line): the torque frame of tick [0-9]* is " "$folder/message"
check $? 5 "one count in one sample is found, with the line of the first torque that differs"
sed '777s/#/?/' "$folder/tour.log" >"$folder/bad.log"
"$trocar" replay "$folder/bad.log" --bank "$bank" >/dev/null 2>"$folder/message"
[ $? -eq 8 ] && grep -q 'bad.log:777: ' "$folder/message"
check $? 6 "a line that is none is refused by its number"
grep ' 181#' "$folder/tour.log" >"$folder/samples.log"
"$trocar" replay "$folder/samples.log" --bank "$bank" >/dev/null 2>"$folder/message"
[ $? -eq 8 ] && grep -q 'no controller ticks' "$folder/message"
check $? 7 "a log without SYNC and torques says that no controller ticks in it"
grep -v ' 201#' "$folder/tour.log" >"$folder/silent.log"
"$trocar" replay "$folder/silent.log" --bank "$bank" --json >"$folder/object" 2>"$folder/message" &&
    [ "$(value agreed)" -eq 0 ] && [ "$(value hashes_differed)" -eq 0 ] && [ "$(value hashes_agreed)" -gt 60 ]
check $? 8 "without its torque frames the state hashes still prove it"
tail -n +9000 "$folder/tour.log" >"$folder/late.log"
"$trocar" replay "$folder/late.log" --bank "$bank" --json >"$folder/object" 2>"$folder/message"
[ $? -eq 12 ] && grep -q '"joined": true' "$folder/object" && grep -q "record from the controller's start" "$folder/message"
check $? 9 "a recording that begins in the middle of a run is told as such"

"$trocar" record "$bank" -o "$folder/tour.log" 2>"$folder/message"
[ $? -eq 3 ] && cmp -s "$folder/tour.log" "$folder/again.log" && grep -q 'overwrites nothing' "$folder/message"
check $? 10 "a file that exists is not overwritten"
lines=$(wc -l <"$folder/again.log")
"$trocar" record "$bank" -n 100 -o "$folder/again.log" --append --json >"$folder/object" 2>"$folder/message" &&
    [ "$(wc -l <"$folder/again.log")" -eq $((lines + $(value frames))) ]
check $? 11 "--append goes on behind the last line"
printf '(0000000000.000100) soft 080#0' >"$folder/cut.log"
"$trocar" record "$bank" -n 100 -o "$folder/cut.log" --append 2>"$folder/message"
[ $? -eq 8 ] && grep -q 'cut.log:1: ' "$folder/message"
check $? 12 "and not behind half a line"

# interrupted in the middle: what was written is whole lines, and replays
printf '%s\nrepeat 900\n' "$("$trocar" run --print-gesture tour)" >"$folder/long"
"$trocar" record "$bank" -g "$folder/long" -o "$folder/cut-short.log" 2>"$folder/message" &
record=$!
until [ -s "$folder/cut-short.log" ]; do kill -0 $record 2>/dev/null || break; done
kill -INT $record
wait $record
[ $? -eq 0 ] && "$trocar" replay "$folder/cut-short.log" --bank "$bank" --json >"$folder/object" 2>>"$folder/message" &&
    [ "$(value differed)" -eq 0 ] && [ "$(value agreed)" -gt 100 ]
check $? 13 "a recording that is interrupted is whole"

"$trocar" monitor "$bank" -g press --fast --lines >"$folder/lines" 2>"$folder/message" && [ "$(wc -l <"$folder/lines")" -ge 3 ] &&
    ! grep -v "load  *[0-9.]* %  *[0-9]* frames/s .*node 1 .*torques agree with the bank's" "$folder/lines" &&
    grep -q 'node 1 RUN, [1-9][0-9.]* N, [1-9] contact\|node 1 RUN, 0\.[1-9]' "$folder/lines"
check $? 14 "monitor shows a simulated session, a line per second"
"$trocar" record "$bank" -g press -o "$folder/press.log" 2>"$folder/message" &&
    "$trocar" monitor "$bank" -g press --fast --frames >"$folder/frames" 2>"$folder/message" &&
    sed 's/  .*//' "$folder/frames" | cmp - "$folder/press.log" && ! grep -v '  [A-Z][A-Za-z]*\( 1\)\{0,1\}: ' "$folder/frames"
check $? 15 "monitor --frames has the recording's frames, each decoded"
"$trocar" monitor "$bank" -g press --fast --json >"$folder/object" 2>"$folder/message" &&
    python3 - "$folder/object" "$(wc -l <"$folder/press.log")" <<'END'
import json, sys
lines = [json.loads(line) for line in open(sys.argv[1])]
last = lines[-1]
assert last["frames"] == int(sys.argv[2]) == sum(entry["count"] for entry in last["ids"])
assert last["mirror"]["agreed"] == last["mirror"]["ticks"] > 2000 and last["mirror"]["differed"] == 0
rates = {entry["name"]: entry["per_second"] for entry in lines[0]["ids"]}
assert 995 < rates["Sync"] < 1005 and 995 < rates["Torques"] < 1005 and 95 < rates["Health"] < 105
assert 0.2 < lines[0]["load"] < 0.45 and last["nodes"][0]["health"]["missed"] == 0
END
check $? 16 "monitor --json counts every frame, and its own torques agree"
"$trocar" monitor "$bank" -g press --fast --frames 2>"$folder/message" | head -n 1 >"$folder/first"
[ "$(wc -l <"$folder/first")" -eq 1 ]
check $? 17 "monitor ends when nobody reads"
"$trocar" monitor --bus socketcan:nowhere0 >"$folder/lines" 2>"$folder/message"
[ $? -eq 8 ] && [ "$(wc -l <"$folder/message")" -eq 1 ] && [ ! -s "$folder/lines" ]
check $? 18 "a bus that is not there ends with exit code 8 and one line"
"$trocar" bridge socketcan:can0 socketcan:can0 2>"$folder/message"
[ $? -eq 2 ] && grep -q 'both sides are the same bus' "$folder/message"
check $? 19 "a bridge needs two buses"
exit $fault
