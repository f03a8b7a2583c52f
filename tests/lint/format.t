#!/bin/sh
# Every C file is laid out as .clang-format says.
echo 1..1
command -v clang-format >/dev/null || { echo "not ok 1 - clang-format is installed"; exit 1; }
faults=$(git ls-files --cached --others --exclude-standard '*.c' '*.h' | xargs clang-format --dry-run -Werror 2>&1 |
    sed -n 's/: error: code should be clang-formatted.*//p' | cut -d: -f1 | sort | uniq -c)
if [ -z "$faults" ]; then
    echo "ok 1 - every C file is laid out as .clang-format says"
else
    echo "not ok 1 - every C file is laid out as .clang-format says (make format does it)"
    echo "$faults" | sed 's/^/# /'
    exit 1
fi
