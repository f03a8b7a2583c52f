#!/bin/sh
# The program's front door: verbs, help, version, explain, and what it says to a wrong word.
trocar=${B:-build}/trocar
count=0
failed=0

# check CLAIM EXIT PATTERN COMMAND...: the command's exit code, and a pattern in what it prints
check()
{
    claim=$1 code=$2 pattern=$3
    shift 3
    said=$("$@" 2>&1)
    got=$?
    count=$((count + 1))
    if [ "$got" -eq "$code" ] && printf '%s\n' "$said" | grep -q -- "$pattern"; then
        echo "ok $count - $claim"
    else
        failed=$((failed + 1))
        echo "not ok $count - $claim"
        printf '%s\n' "exit code $got" "$said" | sed 's/^/# /'
    fi
}
full()
{
    "$trocar" explain >/dev/full
}

[ -x "$trocar" ] || {
    echo "1..0 # SKIP the program is not built"
    exit 0
}
check "--help lists the verbs" 0 '^  run ' "$trocar" --help
check "--version" 0 '^trocar 0\.1\.0$' "$trocar" --version
check "no verb" 2 'no verb is given' "$trocar"
check "a mistyped verb is answered with the nearest" 2 'did you mean trocar build' "$trocar" biuld
check "a word far from every verb gets the help" 2 'see trocar --help' "$trocar" xyzzyxyzzy
check "a very long word is no trouble" 2 'there is no verb' "$trocar" "$(head -c 3000 /dev/zero | tr '\0' a)"
check "control characters do not reach the terminal" 2 'ab?\[31mc' "$trocar" "$(printf 'ab\033[31mc')"
check "explain by name" 0 '^MESH_SYNTAX (-201, exit code 4)' "$trocar" explain mesh_syntax
check "explain by number" 0 '^MESH_SYNTAX (-201, exit code 4)' "$trocar" explain -201
check "explain by the number without its sign" 0 '^MESH_SYNTAX' "$trocar" explain 201
check "explain lists all" 0 '^LOOP_SAFE ' "$trocar" explain
check "explain of what is not there" 2 'no status "PANTS"' "$trocar" explain PANTS
check "a full disk behind stdout is noticed" 3 'cannot write: No space' full
check "--help says what --json does on a failure" 0 'stdout may then hold no JSON' "$trocar" --help
check "run --help says that short runs are not judged" 0 'RUN in 1000 ticks; whether a shorter run' "$trocar" run --help
check "a wrong value is answered with the verb's own help" 2 'see trocar run --help' "$trocar" run --ticks 0 x.bank
check "a file that is not there is no matter of units" 3 'FILE_OPEN' "$trocar" build /no/such.msh -o /tmp/x.bank
for verb in $("$trocar" --help | sed -n 's/^  \([a-z]*\)  .*/\1/p'); do
    check "$verb --help succeeds and shows its usage" 0 "^usage: trocar $verb" "$trocar" "$verb" --help
done
for status in $(sed -n 's/^STATUS(\([A-Z_]*\),.*/\1/p' shared/status.def); do
    "$trocar" explain "$status" | grep -q "^$status (" || missing="$missing $status"
done
check "every status of the table can be explained" 0 '^$' echo "$missing"
echo "1..$count"
[ "$failed" -eq 0 ]
