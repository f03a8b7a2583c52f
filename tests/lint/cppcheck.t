#!/bin/sh
# cppcheck finds nothing in the controller, the host and the simulator.
set -u
build=${B:-build}
echo 1..1
command -v cppcheck >/dev/null || { echo "not ok 1 - cppcheck is installed"; exit 1; }
mkdir -p "$build/lint"
include=
for folder in shared firmware sim host/*/; do include="$include -I$folder"; done
# missingIncludeSystem: headers of libraries are not read, by intent. normalCheckLevelMaxBranches is a note, no finding.
# invalidPointerCast: banks are read in place; their floats are IEEE 754, as every target's are (shared/bank_format.h).
# uninitvar: cppcheck does not follow arrays that nested loops fill; GCC's -Wmaybe-uninitialized, an error here, does.
# unmatchedSuppression: an inline suppression may be needed by one version of cppcheck only.
# unknownMacro, preprocessorErrorDirective: they come from library headers that are not read.
found=$(find firmware shared sim host -name '*.c' | sort |
    xargs cppcheck --quiet --std=c11 --language=c --enable=warning,performance,portability --inline-suppr -j 2 \
    --cppcheck-build-dir="$build/lint" --suppress=missingIncludeSystem --suppress=unmatchedSuppression --suppress=invalidPointerCast --suppress=uninitvar \
    --suppress=unknownMacro --suppress=preprocessorErrorDirective --template='{file}:{line}: {severity}: {message} [{id}]' \
    $include 2>&1)
if [ -z "$found" ]; then
    echo "ok 1 - cppcheck finds nothing"
else
    echo "not ok 1 - cppcheck finds nothing"
    echo "$found" | sed 's/^/# /'
    exit 1
fi
