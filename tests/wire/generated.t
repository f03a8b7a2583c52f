#!/bin/sh
# shared/wire.h and shared/wire.c are what dbcgen makes of shared/wire.dbc today.
build=${B:-build}
folder=$(mktemp -d) || exit 1
trap 'rm -rf "$folder"' EXIT
echo 1..4
fault=0
check() {
    if [ "$1" -eq 0 ]; then echo "ok $2 - $3"; else echo "not ok $2 - $3"; fault=1; fi
}
"$build/dbcgen" shared/wire.dbc "$folder"
check $? 1 "dbcgen accepts shared/wire.dbc"
for file in h c; do
    diff "shared/wire.$file" "$folder/wire.$file" >"$folder/difference"
    check $? "$([ $file = h ] && echo 2 || echo 3)" "shared/wire.$file is fresh (else: $build/dbcgen shared/wire.dbc shared)"
    sed 's/^/# /' "$folder/difference"
done
sed 's/14|14@/13|14@/' shared/wire.dbc >"$folder/overlap.dbc"
"$build/dbcgen" "$folder/overlap.dbc" "$folder" 2>"$folder/message"
[ $? -eq 8 ] && grep -q "overlap.dbc:[0-9]*: signals Alpha and Beta of Encoders overlap" "$folder/message"
check $? 4 "an overlap ends with exit code 8 and names file, line and signals"
exit $fault
