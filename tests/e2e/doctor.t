#!/bin/sh
# trocar doctor: the table, the object, and an exit code of its own when the default path would stop.
build=${B:-build}
folder=$(mktemp -d) || exit 1
trap 'rm -rf "$folder"' EXIT
echo 1..3
fault=0
check() {
    if [ "$1" -eq 0 ]; then echo "ok $2 - $3"; else echo "not ok $2 - $3"; fault=1; fi
}
"$build/trocar" doctor >"$folder/table" && [ "$(grep -c '^[a-z]' "$folder/table")" -eq 4 ] &&
    [ "$(grep -c '^  no ' "$folder/table")" -le "$(grep -c -e '-> ' "$folder/table")" ]
check $? 1 "four groups, and a command for every no"
"$build/trocar" doctor --json | python3 -c '
import json, sys
seen = json.load(sys.stdin)
assert seen["ready"] and len(seen["checks"]) > 15
assert all(bool(check["fix"]) == (check["answer"] != "yes") for check in seen["checks"] if check["name"] != "interfaces")'
check $? 2 "the object says ready, and a fix for what is not there"
cp "$build/trocar" "$folder" && (unset TROCAR_MESHER && "$folder/trocar" doctor >"$folder/table" 2>"$folder/message")
[ $? -eq 10 ] && grep -q '^trocar: trocar-mesher: .*TROCAR_MESHER=' "$folder/message" && [ "$(wc -l <"$folder/message")" -eq 1 ]
check $? 3 "without the mesher the exit code is 10, and one line says what to do"
exit $fault
