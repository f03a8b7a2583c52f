#!/bin/sh
# not sanitised: a guest is too slow for that
# The tools on real SocketCAN with can-utils: what canplayer plays of a recording comes whole through a bridge into `trocar record`
# and candump, the monitor counts it, and both logs give the controller the same torques.
build=$(readlink -f "${B:-build}")
trocar=$build/trocar
folder=$(mktemp -d) || exit 1
trap 'rm -rf "$folder"' EXIT
chmod 755 "$folder"
for tool in canplayer candump cansend stdbuf; do
    command -v $tool >/dev/null || { echo "1..0 # SKIP $tool is not installed (can-utils, coreutils)"; exit 0; }
done
"$trocar" build host/scenes/demo/block.yaml -o "$folder/block.bank" >/dev/null 2>"$folder/message" &&
    "$trocar" record "$folder/block.bank" -g press -o "$folder/played.log" 2>>"$folder/message" || {
    cat "$folder/message"
    exit 1
}
tests/rig/can.sh "$(readlink -f tests/rig/tools.sh)" "$trocar" "$folder" >"$folder/said" 2>"$folder/rig.err"
status=$?
if [ $status -eq 98 ]; then
    echo "1..0 # SKIP SocketCAN was not exercised: $(tail -n 1 "$folder/rig.err")"
    exit 0
fi
echo 1..6
fault=0
check() {
    if [ "$1" -eq 0 ]; then echo "ok $2 - $3"; else
        echo "not ok $2 - $3"
        fault=1
        cat "$folder/said" "$folder"/*.err "$folder"/*.json | cut -c 1-300 | tail -n 30 | sed 's/^/# /'
    fi
}
frames() { # identifiers and data, without the probes
    sed 's/^([^)]*) [^ ]* //' "$1" | grep -v '^7F[01]#'
}
whole() { # the number behind "KEY" in the last object of a file
    sed -n 's/.*"'"$2"'": *\([0-9]*\).*/\1/p' "$folder/$1" | tail -n 1
}
frames "$folder/played.log" >"$folder/played"
frames "$folder/recorded.log" >"$folder/recorded"
frames "$folder/candump.log" >"$folder/dumped"
[ $status -eq 0 ] && [ ! -s "$folder/said" ]
check $? 1 "all tools ran to their end"
cmp -s "$folder/played" "$folder/recorded" && [ "$(whole record.json lost)" -eq 0 ]
check $? 2 "record has every frame that canplayer played on the other side of the bridge, in order"
cmp -s "$folder/recorded" "$folder/dumped"
check $? 3 "candump beside it has the same"
python3 - "$folder" <<'END'
import json, sys
bridge = json.load(open(sys.argv[1] + "/bridge.json"))
heard = len(open(sys.argv[1] + "/recorded.log").readlines())
assert bridge["a_to_b"]["forwarded"] == bridge["a_to_b"]["heard"] >= heard, bridge
assert bridge["b_to_a"] == {"heard": 0, "forwarded": 0, "no_room": 0, "looped": 0, "refused": 0}, bridge
last = [json.loads(line) for line in open(sys.argv[1] + "/monitor.json")][-1]
played = {}
for line in open(sys.argv[1] + "/played"):
    played[int(line.split("#")[0], 16)] = played.get(int(line.split("#")[0], 16), 0) + 1
counted = {entry["id"]: entry["count"] for entry in last["ids"] if entry["id"] not in (0x7F0, 0x7F1)}
assert counted == played, (counted, played)
END
check $? 4 "the bridge forwarded all it heard, and the monitor counted every identifier right"
for log in recorded candump; do
    "$trocar" replay "$folder/$log.log" --bank "$folder/block.bank" --json >"$folder/$log.json" 2>"$folder/$log.err" &&
        [ "$(whole $log.json differed)" -eq 0 ] && [ "$(whole $log.json agreed)" -gt 2000 ] &&
        [ "$(whole $log.json hashes_agreed)" -gt 20 ]
    check $? "$([ $log = recorded ] && echo 5 || echo 6)" "the log of $log gives the controller the recorded torques"
done
exit $fault
