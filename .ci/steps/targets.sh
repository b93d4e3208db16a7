# Steps of .ci/run: bare metal and other processors.
# shellcheck shell=bash

# Debian's toolchain, which brings the sources of `core` and `std` that -Zbuild-std needs.
need_debian_rust() {
    packages rustc-web cargo-web rust-web-src libstd-rust-web-dev lld qemu-user "$@"
    local needed given
    needed=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
    given=$(/usr/bin/rustc --version | cut -d' ' -f2)
    printf '%s\n%s\n' "$needed" "$given" | sort -CV || { echo "rustc $given is older than $needed"; return 1; }
}

# All three variables: cargo would find the other toolchain's programs.
debian_cargo() { RUSTC_BOOTSTRAP=1 RUSTC=/usr/bin/rustc RUSTDOC=/usr/bin/rustdoc /usr/bin/cargo "$@"; }

# What this machine computes in place of the firmware, without building the tests; with the flags of RUSTFLAGS, if any.
numbers() {
    CARGO_TARGET_DIR=$target/numbers${RUSTFLAGS:+-flags} cargo run --quiet --locked \
        --manifest-path embed-example/firmware/Cargo.toml --example firmware_probe -- "$@"
}

# Path of an emulator of a whole Cortex-M7 machine; fails if there is none. The release's package is unpacked where it
# cannot be installed beside a newer one of the image's.
machine_emulator() {
    local folder=$target/qemu-system-arm
    if command -v qemu-system-arm; then return; fi
    if [ ! -x "$folder/usr/bin/qemu-system-arm" ]; then
        rm -rf "$folder" && mkdir -p "$folder"
        (cd "$folder" && apt-get download -qq qemu-system-arm && dpkg -x qemu-system-arm_*.deb .) >/dev/null 2>&1 || return 1
        packages libcapstone4 libdaxctl1 libfdt1 libibverbs1 libndctl6 libpixman-1-0 libpmem1 librdmacm1 libslirp0 libvdeplug2
    fi
    "$folder/usr/bin/qemu-system-arm" --version >/dev/null && echo "$folder/usr/bin/qemu-system-arm"
}

# Builds the firmware and prints what program `$1` prints. On a machine model if there is an emulator of one, otherwise as
# a process of a user-mode emulator.
run_firmware() {
    local build="--release --locked -Zbuild-std=core --target thumbv7em-none-eabihf" emulator
    export CARGO_TARGET_DIR=$target/firmware
    if emulator=$(machine_emulator); then
        (cd embed-example/firmware && debian_cargo build --quiet $build)
        "$emulator" -M mps2-an500 -nographic -monitor none -serial none -semihosting-config enable=on,target=native \
            -icount shift=0 -kernel "$CARGO_TARGET_DIR/thumbv7em-none-eabihf/release/$1" </dev/null
    else
        echo "no emulator of a machine: user mode" >&2
        export CARGO_TARGET_DIR=$target/firmware-user
        (cd embed-example/firmware && debian_cargo build --quiet $build --features user-mode)
        qemu-arm -cpu max "$CARGO_TARGET_DIR/thumbv7em-none-eabihf/release/$1"
    fi
}

# Bytes of flash and RAM of the firmware, of what there is, and the calls of the panic handler that the optimiser left:
# `name number` per line.
firmware_sizes() {
    local elf=$target/firmware/thumbv7em-none-eabihf/release/firmware
    arm-none-eabi-size -A "$elf" | awk '
        { size[$1] = $2 }
        END {
            print "flash", size[".text"] + size[".rodata"] + size[".data"]
            print "flash_code", size[".text"]
            print "flash_constants", size[".rodata"]
            print "ram", size[".stack"] + size[".data"] + size[".bss"]
            print "ram_stack", size[".stack"]
        }'
    arm-none-eabi-nm -CS --radix=d "$elf" | awk '
        $4 == "firmware::SESSION" { print "ram_session", $2 + 0 }
        $4 == "firmware::SHARD" { print "ram_shard", $2 + 0 }' | sort
    arm-none-eabi-objdump -dC --no-show-raw-insn "$elf" | awk '
        /^[0-9a-f]+ <.*>:$/ { inside = /<core::(panicking|slice|option|result)/ }
        !inside && /\t(b|bl|b\.w|b\.n)\t.* <core::(panicking|slice::index::slice|slice::copy_from|option::(unwrap|expect)|result::unwrap)/ { n++ }
        END { print "panic_calls", n + 0 }'
}

# Cortex-M7 programs without an operating system, a heap or a library: arithmetic gives the numbers of this machine, and
# the picture is every host's. No number of embed-example/firmware/sizes.txt rises by more than 2 %; `BLESS=1` rewrites it.
step_firmware() {
    need_debian_rust binutils-arm-none-eabi
    run_firmware probe >"$target/probe.firmware"
    cat "$target/probe.firmware"
    numbers >"$target/probe.v3"
    local other
    for other in v3 baseline; do
        # The baseline's results exist if its step ran.
        if [ "$other" = v3 ] || [ -f "$target/probe.$other" ]; then
            diff "$target/probe.firmware" "$target/probe.$other" || { echo "firmware and $other disagree"; return 1; }
        fi
    done
    run_firmware firmware >"$target/picture.firmware"
    cat "$target/picture.firmware"
    numbers --picture >"$target/picture.v3"
    diff "$target/picture.v3" <(head -n "$(wc -l <"$target/picture.v3")" "$target/picture.firmware")
    grep -qx "A $(sed -n 's/^picture //p' "$target/picture.firmware")" embed-example/hashes.txt
    # a program of the user-mode emulator is laid out in another way
    [ -f "$target/firmware/thumbv7em-none-eabihf/release/firmware" ] || return 0
    { firmware_sizes; grep -E '^(stack_used|time_tracing|time_ending) ' "$target/picture.firmware"; } >"$target/firmware.sizes"
    cat "$target/firmware.sizes"
    if [ -n "${BLESS-}" ]; then cp "$target/firmware.sizes" embed-example/firmware/sizes.txt; fi
    diff <(cut -d' ' -f1 embed-example/firmware/sizes.txt) <(cut -d' ' -f1 "$target/firmware.sizes")
    paste -d' ' embed-example/firmware/sizes.txt "$target/firmware.sizes" |
        awk '$4 > 1.02 * $2 { print $1 ": " $4 " is more than " $2; bad = 1 } END { exit bad }'
}

# Another processor: 64-bit ARM in an emulator gets the picture of every host and the numbers of the probe. A big-endian one
# is refused when it is compiled. Firmware and browser are 32-bit ones.
step_targets() { other_processors "" aarch64; }

# The same with the tests of the core, which take minutes to build, and for 32-bit x86.
step_night_targets() { other_processors ,test aarch64 i686; }

# `step_targets` for some processors, with a crate of test programs or without: `other_processors [,test] PROCESSOR...`
other_processors() {
    need_debian_rust gcc-aarch64-linux-gnu libc6-dev-arm64-cross
    [[ $* != *i686* ]] || packages gcc-i686-linux-gnu libc6-dev-i386-cross
    numbers >"$target/probe.v3"
    export CARGO_TARGET_DIR=$target/targets CARGO_PROFILE_DEV_DEBUG=0 CARGO_PROFILE_TEST_DEBUG=0
    export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc
    export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER="qemu-aarch64 -L /usr/aarch64-linux-gnu"
    export CARGO_TARGET_I686_UNKNOWN_LINUX_GNU_LINKER=i686-linux-gnu-gcc
    # static: the loader and the libraries of that processor need not be installed
    export CARGO_TARGET_I686_UNKNOWN_LINUX_GNU_RUSTFLAGS="-C target-feature=+crt-static"
    local tests=$1 processor options example message
    for processor in "${@:2}"; do
        options="--locked -Zbuild-std=std,panic_unwind$tests --target $processor-unknown-linux-gnu"
        # what is skipped takes the emulator minutes, with integers only
        [ -z "$tests" ] || debian_cargo test $options -p croupier-simd -p croupier --lib -- \
            --skip shards_own_their_share_of_odd_pictures
        debian_cargo check $options -p croupier-capi
        example="run --quiet $options --manifest-path embed-example/firmware/Cargo.toml --example firmware_probe"
        diff "$target/probe.v3" <(debian_cargo $example) || { echo "$processor computes other numbers"; return 1; }
        debian_cargo $example -- --picture >"$target/picture.$processor"
        cat "$target/picture.$processor"
        grep -qx "A $(sed -n 's/^picture //p' "$target/picture.$processor")" embed-example/hashes.txt
    done
    message=$(debian_cargo check --locked -Zbuild-std=core --target s390x-unknown-linux-gnu -p croupier 2>&1) &&
        { echo "a big-endian target is not refused"; return 1; }
    grep 'croupier needs a little-endian target' <<<"$message" || { echo "$message"; return 1; }
}
