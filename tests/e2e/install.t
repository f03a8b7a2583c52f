#!/bin/sh
# host/dependencies.sh on machines of every kind, played by stand-ins for dpkg-query, apt-get, id and sudo: what is missing
# is installed or named, in one line, and nothing is touched otherwise.
set -u
script=$PWD/host/dependencies.sh
place=$(mktemp -d) || exit 1
trap 'rm -rf "$place"' EXIT
tools=$place/tools
count=0 failed=0

result()
{
    count=$((count + 1))
    if [ "$1" -eq 0 ]; then
        echo "ok $count - $2"
    else
        echo "not ok $count - $2"
        sed 's/^/# /' "$place/out"
        [ -e "$place/calls" ] && sed 's/^/# called: /' "$place/calls"
        failed=1
    fi
}

# machine UID INSTALLED SUDO NETWORK: the stand-ins. INSTALLED: the packages that dpkg-query knows as installed.
machine()
{
    rm -rf "$tools" "$place/calls" "$place/installed"
    mkdir "$tools"
    for tool in sh true sed grep tail mktemp rm env cat printf tr; do
        for folder in /usr/bin /bin; do # not `command -v`, which answers with the shell's own for some
            [ -x "$folder/$tool" ] && ln -sf "$folder/$tool" "$tools/$tool"
        done
    done
    printf '%s\n' $2 >"$place/installed"
    printf '#!/bin/sh\necho %s\n' "$1" >"$tools/id"
    cat >"$tools/dpkg-query" <<EOF
#!/bin/sh
shift 2
status=0
for p; do
    if grep -qx "\$p" $place/installed; then echo "installed \$p"; else status=1; fi
done
exit \$status
EOF
    cat >"$tools/apt-get" <<EOF
#!/bin/sh
echo "apt-get \$*" >>$place/calls
[ "$4" = up ] || { echo "E: Unable to locate package gcc"; exit 100; }
for word; do echo "\$word" >>$place/installed; done
EOF
    if [ "$3" = sudo ]; then
        printf '#!/bin/sh\necho "sudo $*" >>%s\nshift\nexec "$@"\n' "$place/calls" >"$tools/sudo"
    fi
    chmod +x "$tools"/id "$tools"/dpkg-query "$tools"/apt-get
    [ -e "$tools/sudo" ] && chmod +x "$tools/sudo"
    return 0
}

play()
{
    PATH=$tools "$tools/sh" "$script" "$@" >"$place/out" 2>&1
    status=$?
    lines=$(wc -l <"$place/out")
}

says()
{
    grep -qF -- "$1" "$place/out"
}

echo 1..10
# every name of the groups, by asking on a machine where nothing is installed
machine 1000 none none up
play build test
all=$(sed 's/.*--no-install-recommends//' "$place/out")
[ $status -ne 0 ] && [ "$lines" -eq 1 ] && says "run as root: apt-get update && apt-get install -y --no-install-recommends gcc" &&
    says libgmsh-dev && says libcmocka-dev && [ ! -e "$place/calls" ]
result $? "an ordinary user gets one line with the exact command, and nothing runs"

machine 0 "$all" none up
play build test
[ $status -eq 0 ] && [ "$lines" -eq 0 ] && [ ! -e "$place/calls" ]
result $? "with everything there it is silent and calls nothing"

machine 0 "$(echo "$all" | sed 's/ zlib1g-dev / /')" none up
play build test
[ $status -eq 0 ] && [ "$lines" -eq 1 ] && [ "$(wc -l <"$place/calls")" -eq 2 ] &&
    grep -q 'install -y --no-install-recommends zlib1g-dev$' "$place/calls"
result $? "root gets only the missing package installed, after one update"

machine 1000 "$(echo "$all" | sed 's/ zlib1g-dev / /')" sudo up
play build test
[ $status -eq 0 ] && grep -q '^sudo -n env .*install' "$place/calls"
result $? "a user with sudo that asks nothing gets it installed through sudo"

machine 0 "$(echo "$all" | sed 's/ zlib1g-dev / /')" none down
play build test
[ $status -ne 0 ] && [ "$(grep -c 'apt-get update && apt-get install -y --no-install-recommends zlib1g-dev$' "$place/out")" -eq 1 ] &&
    says "E: Unable to locate package"
result $? "without a network the line has apt's reason and the command"

machine 0 none none up
play --check build
[ $status -ne 0 ] && [ "$lines" -eq 1 ] && says "run: apt-get install" && [ ! -e "$place/calls" ]
result $? "--check names what is missing and installs nothing"

machine 0 none none up
rm "$tools/dpkg-query"
play build
[ $status -ne 0 ] && [ "$lines" -eq 1 ] && says "not a Debian system" && says libgmsh-dev
result $? "another system gets one line with the names"

play --check build
[ $status -eq 0 ] && [ "$lines" -eq 0 ]
result $? "another system may build with what it has"

machine 0 "$all" none up
play nonsense
[ $status -ne 0 ] && [ "$lines" -eq 1 ] && says "no group named 'nonsense'"
result $? "an unknown group is refused"

machine 0 "$(echo "$all" | sed 's/ python3 / python3-minimal /')" none up
play test
[ $status -eq 0 ] && grep -q 'recommends python3$' "$place/calls"
result $? "a package whose name only begins alike does not count"
exit $failed
