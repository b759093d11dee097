#!/usr/bin/env bash
# Builds the program for 64-bit ARM (Raspberry Pi and others) on x86-64, runs unit tests under qemu, and compares the digests of
# lockstep runs with those of this machine.
#
#     rustup target add aarch64-unknown-linux-gnu
#     sudo apt install gcc-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user
#     arbiter/cli/package/aarch64.sh                       # or with one of: build, test, functions, compare
#
# `functions` compares the functions of the C library, bit by bit; those that differ must not be called (clippy.toml).
#
# Environment: CARGO and RUSTC, the toolchain (cargo, rustc); PROFILE (release; `dev` compiles faster); FLAGS, additional arguments of
# cargo, such as `--features view`; TASKS, the tasks to compare (corridor hallway); QEMU, the emulator with its arguments.
set -euo pipefail
cd "$(dirname "$0")/../../.."

target=aarch64-unknown-linux-gnu
cargo=${CARGO:-cargo}
profile=${PROFILE:-release}
read -r -a flags <<< "${FLAGS:-}"
read -r -a tasks <<< "${TASKS:-corridor hallway}"
qemu=${QEMU:-qemu-aarch64 -L /usr/aarch64-linux-gnu}
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=${CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER:-aarch64-linux-gnu-gcc}
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER=$qemu
folder=${CARGO_TARGET_DIR:-target}
[ "$profile" = dev ] && built=debug || built=$profile

build() {
    "$cargo" build --profile "$profile" --target "$target" -p yamabico "${flags[@]}"
    file "$folder/$target/$built/yamabico" 2> /dev/null || true
}

run_tests() {
    "$cargo" test --profile "${PROFILE:-test}" --target "$target" --lib "${flags[@]}" \
        -p yamabico-geometry -p yamabico-core -p yamabico-arbiter
}

functions() {
    local source=core/geometry/examples/math_functions.rs out
    out=$(mktemp -d)
    "${RUSTC:-rustc}" -O --edition 2024 "$source" -o "$out/here"
    "${RUSTC:-rustc}" -O --edition 2024 --target "$target" \
        -C linker="$CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER" "$source" -o "$out/there"
    "$out/here" > "$out/here.txt"
    # shellcheck disable=SC2086 # the emulator and its arguments
    $qemu "$out/there" > "$out/there.txt"
    echo "functions that differ between $(uname -m) and aarch64:"
    { diff "$out/here.txt" "$out/there.txt" || true; } | sed -n 's/^< \(.*\):.*/    \1/p'
    rm -r "$out"
}

# Digest of a task, by a program.
digest() {
    local task=$1 out
    shift
    out=$(mktemp -d)
    "$@" run "configs/$task.toml" --no-report --no-overlays --out "$out" | sed -n 's/^digest //p'
    rm -r "$out"
}

compare() {
    local task here there differs=0
    "$cargo" build --profile "$profile" -p yamabico "${flags[@]}"
    for task in "${tasks[@]}"; do
        here=$(digest "$task" "$folder/$built/yamabico")
        # shellcheck disable=SC2086 # the emulator and its arguments
        there=$(digest "$task" $qemu "$folder/$target/$built/yamabico")
        echo "$task: $(uname -m) $here, aarch64 $there"
        [ -n "$here" ] && [ "$here" = "$there" ] || differs=1
    done
    return $differs
}

case ${1:-all} in
    build) build ;;
    test) run_tests ;;
    functions) functions ;;
    compare) build && compare ;;
    all) build && run_tests && functions && compare ;;
    *) sed -n '2,15p' "$0" && exit 2 ;;
esac
