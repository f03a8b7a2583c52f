#!/bin/sh
# tools.sh TROCAR FOLDER   in the rig: canplayer plays FOLDER/played.log on vcan0, a bridge carries it to vcan1; monitor
# listens on vcan0, record and candump on vcan1. Everything is written to FOLDER. Run by tools.t.
set -u
trocar=$1
folder=$2
"$trocar" record --bus socketcan:vcan1 -o "$folder/recorded.log" --json >"$folder/record.json" 2>"$folder/record.err" &
record=$!
stdbuf -oL candump -r 8000000 -L vcan1 >"$folder/candump.log" 2>"$folder/candump.err" &
candump=$!
"$trocar" monitor --bus socketcan:vcan0 --json --every 100 >"$folder/monitor.json" 2>"$folder/monitor.err" &
monitor=$!
"$trocar" bridge socketcan:vcan0 socketcan:vcan1 --json >"$folder/bridge.json" 2>"$folder/bridge.err" &
bridge=$!
# all listen when all have heard a probe
n=0
until [ -s "$folder/recorded.log" ] && [ -s "$folder/candump.log" ] && grep -q '"id":2032' "$folder/monitor.json"; do
    n=$((n + 1))
    [ $n -gt 300 ] && break
    cansend vcan0 7F0#
done
canplayer -I "$folder/played.log" vcan0=soft || echo "canplayer failed"
# a last probe has passed: so has everything before it
cansend vcan0 7F1#
n=0
until grep -q ' 7F1#' "$folder/candump.log" && grep -q ' 7F1#' "$folder/recorded.log" &&
    grep -q '"id":2033' "$folder/monitor.json"; do
    n=$((n + 1))
    [ $n -gt 300 ] && break
done
kill -INT $bridge $record $monitor $candump
for process in $bridge $record $monitor; do
    wait $process || echo "a tool ended with $?"
done
wait $candump
exit 0
