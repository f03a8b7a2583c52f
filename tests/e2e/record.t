#!/bin/sh
# trocar record and replay: a simulated session as a candump log, whole and damaged, through the controller again.
trocar=${B:-build}/trocar
folder=$(mktemp -d) || exit 1
trap 'rm -rf "$folder"' EXIT
bank=$folder/block.bank
echo 1..13
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
exit $fault
