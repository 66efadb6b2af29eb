#!/usr/bin/env bash
# Check the C kernel without Python: vectors by every compiler, sanitizers, a fuzzer.
#
#     benchmarks/kernel_check/kernel.sh [SECONDS]      fuzz for an hour by default; CI takes 10 s
#
# Compilers that are not installed are left out, and named. All that compute in double precision
# with one libm must get the same bits: the digest of check_vectors is compared.
set -euo pipefail
cd "$(dirname "$0")/../.."
seconds=${1:-3600}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
strict=(-Wall -Wextra -Wconversion -pedantic -Werror -ffp-contract=off -I src/holdfast/kernel
    -I "$folder")
n_missing=0
.venv/bin/python tests/kernel/write_vectors.py > "$folder/vectors.h"

# check WORDS...: compile check_vectors by these words and run it. Print the result.
check() {
    "$@" "${strict[@]}" tests/kernel/check_vectors.c -o "$folder/check" -lm
    printf '%-66s %s\n' "$*" "$("$folder/check" | tee "$folder/last" | tail -1)"
}

has() {
    command -v "$1" > /dev/null || { echo "left out: no $1"; n_missing=$((n_missing + 1)); return 1; }
}

expected=
for compiler in gcc clang g++ clang++; do
    has "$compiler" || continue
    language=(-std=c99) levels=(-O0 -O2 -O3)
    # that the header is C++ too; the bits of every level are those of the C compilers
    [[ $compiler = *++ ]] && language=(-x c++ -std=c++11) levels=(-O2)
    for level in "${levels[@]}"; do
        for sizes in "" -DHOLDFAST_VECTORS_FIXED; do
            check "$compiler" "${language[@]}" "$level" ${sizes:+"$sizes"}
            digest=$(sed -n 's/.*digest //p' "$folder/last")
            if [ "$digest" != "${expected:=$digest}" ]; then
                echo "other bits than the first compiler: $digest, $expected expected" >&2
                exit 1
            fi
        done
        check "$compiler" "${language[@]}" "$level" -DHOLDFAST_SINGLE -DHOLDFAST_VECTORS_FIXED
    done
done

for compiler in gcc clang; do
    has "$compiler" || continue
    check "$compiler" -std=c99 -g -O1 -fsanitize=address,undefined -fno-sanitize-recover=all
done

# Another processor and another libm: the same faults, and numbers within the tolerance.
if has aarch64-linux-gnu-gcc && has qemu-aarch64; then
    aarch64-linux-gnu-gcc -std=c99 -O2 -static "${strict[@]}" tests/kernel/check_vectors.c \
        -o "$folder/check" -lm
    printf '%-66s %s\n' "aarch64-linux-gnu-gcc -O2" "$(qemu-aarch64 "$folder/check" | tail -1)"
fi

if has clang; then
    clang -std=c99 -g -O1 "${strict[@]}" -fsanitize=fuzzer,address,undefined \
        -fno-sanitize-recover=all tests/kernel/fuzz_kernel.c -o "$folder/fuzz"
    mkdir "$folder/corpus"
    if ! "$folder/fuzz" -max_total_time="$seconds" -max_len=4096 -len_control=10 \
        -artifact_prefix="$folder/" "$folder/corpus" > "$folder/log" 2>&1; then
        tail -40 "$folder/log" >&2
        exit 1
    fi
    grep '^Done' "$folder/log"
fi
[ "$n_missing" = 0 ] || echo "$n_missing commands left out"
