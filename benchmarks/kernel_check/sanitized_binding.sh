#!/usr/bin/env bash
# Runs the tests of the binding with an extension that has gcc's sanitizers of addresses and of
# undefined behaviour. Works in a copy: the extension of the clone stays as it is.
#
#     benchmarks/kernel_check/sanitized_binding.sh [more tests of pytest]
set -euo pipefail
cd "$(dirname "$0")/../.."
python=$PWD/.venv/bin/python
copy=$(mktemp -d)
trap 'rm -rf "$copy"' EXIT
cp -r pyproject.toml setup.py MANIFEST.in README.md LICENSE conftest.py src tests "$copy"
cd "$copy"
sanitizers="-fsanitize=address,undefined -fno-sanitize-recover=undefined"
CFLAGS="-g -fno-omit-frame-pointer $sanitizers" LDFLAGS="$sanitizers" CC=gcc \
    "$python" -c "import setup; setup.build_editable('.')" > build.txt || { cat build.txt; exit 1; }
# Python itself leaks at exit, and its own allocator would hide the ends of objects. With -s the
# report of a sanitizer is not captured.
LD_PRELOAD="$(gcc -print-file-name=libasan.so) $(gcc -print-file-name=libstdc++.so)" \
    ASAN_OPTIONS=detect_leaks=0 PYTHONMALLOC=malloc PYTHONPATH="$copy/src" \
    "$python" -m pytest -s -o addopts= -q -p no:cacheprovider -p no:randomly \
    tests/kernel/test_batch.py tests/kernel/test_stream.py tests/kernel/test_detector.py \
    tests/kernel/test_tables.py tests/twin/test_steps.py "$@"
