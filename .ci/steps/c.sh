# Steps of .ci/run: the C interface, and many processes that use it.
# shellcheck shell=bash

# Hash of a picture of the examples, or of a test of the C interface.
hash_of() { sed -n "s/^$1 //p" embed-example/hashes.txt core/capi/tests/c/hashes.txt; }

# A program prints the hash of a picture: `renders A program arguments...`
renders() {
    local name=$1 found
    shift
    found=$("$@" | tail -1)
    echo "$name $found: $*"
    [ "$found" = "$(hash_of "$name")" ]
}

# One picture on several processes: `on_processes N PROGRAM ARGUMENTS...`. Threads of Open MPI are not to be bound to cores.
# What takes seconds and is not over after five minutes hangs.
on_processes() {
    timeout --kill-after 10 300 mpirun --oversubscribe --allow-run-as-root --bind-to none -n "$1" "${@:2}"
}

# Three processes of which one gets a signal in the second iteration draw the picture with this hash:
# `loses SIGNAL RANK HASH PROGRAM SCENE ARGUMENTS...`. They write into files of their own accord: what mpirun passes on may be
# lost when the job ends.
loses() {
    local said=$target/cluster.said picture=$target/lost.ppm
    rm -f "$picture" "$said"*
    # shellcheck disable=SC2016
    LOST=$2 LOST_SIGNAL=$(kill -l "$1") on_processes 3 --enable-recovery sh -c 'exec "$@" >>"$0.out" 2>>"$0.err"' \
        "$said" "$4" "$5" "$picture" "${@:6}" || { tail "$said.err"; return 1; }
    echo "SIG$1 to rank $2: $(tail -1 "$said.out") $(grep -c 'its shards go to others' "$said.err") times given up"
    grep -q "rank $2 .*: its shards go to others" "$said.err" || { tail "$said.err"; return 1; }
    [ "$(tail -1 "$said.out")" = "$3" ]
    [ -s "$picture" ]
}

# A program fails and says why: `refuses TEXT program arguments...`
refuses() {
    local output
    output=$("${@:2}" 2>&1) && { echo "not refused: ${*:2}"; return 1; }
    grep -F -- "$1" <<<"$output" || { echo "not '$1': $output"; return 1; }
}

# Packages stage an installation: the same files below DESTDIR, and nothing where they will be.
check_staged() {
    local stage=$target/stage prefix=$target/never-installed
    rm -rf "$stage" "$prefix"
    DESTDIR=$stage .ci/install-c "$prefix"
    [ ! -e "$prefix" ]
    diff -r "$1" "$stage$prefix"
    DESTDIR=$stage refuses 'DESTDIR needs an absolute PREFIX' .ci/install-c relative
}

# What may go wrong in cluster.c without a process that dies: arguments, writing, messages that come twice or late.
check_cluster() {
    local cluster=$1 box=$2 picture=$target/broken.ppm checked=$target/cluster-checked err=$target/cluster.err wanted argument
    for argument in -1 0 1e9 1.5 4x ''; do
        refuses "'$argument' is no whole number" on_processes 1 "$cluster" "$box" "$picture" 60 "$argument"
    done
    refuses "'x' is no number" on_processes 1 "$cluster" "$box" "$picture" x 1
    # the name of the unfinished picture leads to a full disk
    rm -f "$picture" "$picture.0.part"
    ln -s /dev/full "$picture.0.part"
    refuses 'No space left' on_processes 1 "$cluster" "$box" "$picture" 60 1
    [ ! -e "$picture" ] && [ ! -L "$picture.0.part" ]

    # shellcheck disable=SC2086
    mpicc -std=c99 -O2 -Wall -Wextra -pedantic -Werror -DTAGS=24 embed-example/cluster/cluster.c \
        embed-example/cluster/checked.c $3 -o "$checked"
    wanted=$(on_processes 1 "$cluster" "$box" "$picture" 60 1 1 2 2 4 2>/dev/null)
    [ "$(on_processes 3 "$checked" "$box" "$picture" 60 1 1 2 2 4 2>"$err")" = "$wanted" ]
    grep 'sends its first shard again' "$err"
    if grep 'its shards go to others' "$err"; then return 1; fi
    [ ! -e "$picture.0.part" ]
}

# Many machines: processes that MPI connects over the C interface have the hash of one, and so have those that are left when
# one of them dies or hangs. Before that, how the C library is installed.
step_cluster() {
    packages gcc libc6-dev pkg-config openmpi-bin libopenmpi-dev
    local prefix=$target/installed-c cluster=$target/cluster lost=$target/cluster-lost n flags wanted
    local box=$PWD/embed-example/box.crp picture=$target/cluster.ppm
    rm -rf "$prefix"
    .ci/install-c "$prefix"
    check_staged "$prefix"
    flags=$(PKG_CONFIG_PATH=$prefix/lib/pkgconfig pkg-config --cflags --libs croupier)
    # shellcheck disable=SC2086
    mpicc -std=c99 -O2 -Wall -Wextra -pedantic -Werror embed-example/cluster/cluster.c $flags -o "$cluster"
    export LD_LIBRARY_PATH=$prefix/lib
    for n in 1 2 3 8; do renders B on_processes $n "$cluster" "$box" "$picture"; done
    check_cluster "$cluster" "$box" "$flags"
    # shellcheck disable=SC2086
    mpicc -std=c99 -O2 -Wall -Wextra -pedantic -Werror embed-example/cluster/cluster.c embed-example/cluster/lost.c \
        $flags -o "$lost"
    wanted=$(on_processes 1 "$cluster" "$box" "$picture" 5 4 8 2>/dev/null)
    loses KILL 1 "$wanted" "$lost" "$box" 5 4 8
    loses KILL 0 "$wanted" "$lost" "$box" 5 4 8
    loses STOP 2 "$wanted" "$lost" "$box" 5 4 8
}

# Instructions within functions and what they call: `instructions PATTERN program arguments...`
instructions() {
    valgrind --tool=callgrind --toggle-collect="$1" --callgrind-out-file="$target/c.callgrind" "${@:2}" >/dev/null 2>&1
    sed -n 's/^\(totals\|summary\): \([0-9]*\).*/\2/p' "$target/c.callgrind" | tail -1
}

# What a call of the interface costs, in instructions of the steps of picture A: all that is not in the tracer's own loop, of
# which a program in Rust has some, too. At most 1 %.
check_overhead() {
    local box=$1 library=$target/c-x86-64-v3/release rust=$target/c-x86-64-v3/release/overhead steps tracer own
    (cd core/capi/library && RUSTFLAGS="-C target-cpu=x86-64-v3" CARGO_TARGET_DIR=$target/c-x86-64-v3 \
        cargo build --release --locked --features overhead,guiding --bin overhead)
    renders A "$rust" "$box"
    # with the names of functions, which the installed one has not
    mkdir -p "$target/c/named"
    cp "$library/libcroupier.so" "$target/c/named/libcroupier.so.0"
    local run=("$target/c/box" "$box" "$target/c/box.ppm")
    steps=$(LD_LIBRARY_PATH=$target/c/named instructions croupier_shard_step "${run[@]}")
    tracer=$(LD_LIBRARY_PATH=$target/c/named instructions '*tracer::pipeline::turn*' "${run[@]}")
    own=$(($(instructions rust_shard_step "$rust" "$box") - $(instructions '*tracer::pipeline::turn*' "$rust" "$box")))
    echo "$steps instructions of steps in C, $((steps - tracer)) of them around the tracer; $own in Rust"
    # what is not found counts 0, or nothing
    [ "${tracer:-0}" -gt 0 ] && [ "${steps:-0}" -gt "$tracer" ] && [ "$own" -gt 0 ] && [ $(((steps - tracer - own) * 100)) -le "$steps" ]
}

# The header is that of the sources, in C99 and C++17.
check_header() {
    local tool=$target/cbindgen/bin/cbindgen
    [ "$("$tool" --version 2>/dev/null)" = "cbindgen 0.29.4" ] ||
        CARGO_TARGET_DIR=$target/cbindgen/build cargo install --debug cbindgen --version =0.29.4 --locked --root "$target/cbindgen"
    (cd core/capi && "$tool" --quiet --config cbindgen.toml --crate croupier-capi --output include/croupier.h --verify .)
    gcc -std=c99 -Wall -Wextra -pedantic -Werror -Icore/capi/include -c core/capi/tests/c/header.c -o "$target/header.o"
    g++ -x c++ -std=c++17 -Wall -Wextra -pedantic -Werror -Icore/capi/include -c core/capi/tests/c/header.c \
        -o "$target/header.o"
}

# What a program calls while it renders contains no panic: it links where panics have no function, with the tracer, which only
# functions that make sessions name. `croupier_plan_init`, which formats texts, does not: the check can fail.
check_panics() {
    (cd core/capi/library && RUSTFLAGS="-C target-cpu=x86-64-v3" CARGO_TARGET_DIR=$target/c-link-check \
        cargo rustc --release --locked --features link-check,guiding --crate-type staticlib)
    local build=(gcc -std=c99 -Wall -Wextra -Icore/capi/include core/capi/tests/c/hot.c -Wl,--gc-sections
        -Wl,-u,croupier_session_init,-u,croupier_session_init_with
        "$target/c-link-check/release/libcroupier.a" -o "$target/hot")
    "${build[@]}"
    local turns
    turns=$(nm -C "$target/hot" | grep -c 'tracer::pipeline::turn')
    echo "$turns tracers without a panic"
    # four sets of callbacks, each with path guiding and without
    [ "$turns" -ge 8 ]
    ! "${build[@]}" -Wl,-u,croupier_plan_init 2>/dev/null
}

# The other example of the manual, the body of a function with what its text says is there, and the one for programs with
# Embree, against the declarations that it uses: they compile.
check_manual() {
    local prefix=$1 out=$2
    {
        echo '#include <croupier.h>'
        echo 'void manual(const float (*positions)[3], const uint32_t (*triangles)[3], void *blob, void *scratch);'
        echo 'void manual(const float (*positions)[3], const uint32_t (*triangles)[3], void *blob, void *scratch) {'
        awk '/^```c$/ { n++; inside = n == 2; next } /^```$/ { inside = 0 } inside' docs/C.md
        echo '}'
    } >"$out/manual.c"
    [ "$(wc -l <"$out/manual.c")" -gt 10 ]
    gcc -std=c99 -Wall -Wextra -Werror -I"$prefix/include" -c "$out/manual.c" -o "$out/manual.o"
    sed -n '/^```c$/,/^```$/{/^```/!p}' docs/FROM_EMBREE.md >"$out/embree.c"
    gcc -std=c99 -Wall -Wextra -Werror -I"$prefix/include" -Icore/capi/tests/c -c "$out/embree.c" -o "$out/embree.o"
}

# Programs say when a picture cannot be written, and name a scene that is not there. In `step_c` only: uses its variables.
check_full_disk() {
    local program
    for program in box threads; do
        if LD_LIBRARY_PATH=$lib "$out/$program" "$box" /dev/full >/dev/null; then return 1; fi
    done
    { LD_LIBRARY_PATH=$lib "$out/threads" "$out/no-scene" "$out/threads.ppm" 2>&1 || [ $? = 1 ]; } | grep 'cannot read .*no-scene'
}

# The C interface: header, libraries as they are installed, examples in C, C++ and Python with the hashes of Rust, memory,
# instruction sets, panics, and what a call costs.
step_c() {
    [ "$(uname -m)" = x86_64 ] && grep -qw avx2 /proc/cpuinfo || { echo "x86-64 with AVX2 only"; return $skipped; }
    packages gcc g++ libc6-dev make cmake pkg-config python3-minimal valgrind qemu-user
    check_header
    local prefix=$target/installed-c out=$target/c box=$PWD/embed-example/box.crp c=$PWD/embed-example/c lib fast
    rm -rf "$prefix" "$out"
    mkdir -p "$out"
    .ci/install-c "$prefix"
    lib=$prefix/lib fast=$prefix/lib/glibc-hwcaps/x86-64-v3
    # nothing else is exported, and the static library leaves room for another one in Rust
    local names
    names=$(nm -D --defined-only "$lib/libcroupier.so" "$fast/libcroupier.so.0" && nm -g --defined-only "$lib"/*.a)
    if grep ' [A-Z] ' <<<"$names" | grep -v ' croupier_'; then return 1; fi

    local flags
    flags=$(PKG_CONFIG_PATH=$lib/pkgconfig pkg-config --cflags --libs croupier)
    # shellcheck disable=SC2086
    gcc -std=c99 -O2 -g -Wall -Wextra -pedantic -Werror "$c/box.c" $flags -o "$out/box"
    # shellcheck disable=SC2086
    g++ -std=c++17 -O2 -g -Wall -Wextra -pedantic -Werror "$c/threads.cpp" $flags -pthread -o "$out/threads"
    gcc -std=c99 -Wall -Wextra -pedantic -Werror -I"$prefix/include" "$c/box.c" "$lib/libcroupier.a" -o "$out/static"
    sed -n '/^```c$/,/^```$/{/^```/!p}' README.md >"$out/readme.c"
    gcc -std=c99 -Wall -Wextra -Werror -I"$prefix/include" "$out/readme.c" core/capi/tests/c/example.c "$lib/libcroupier.a" \
        -Wl,--wrap=croupier_{session_begin_iteration,shard_step,session_finish_iteration} -o "$out/example"
    "$out/example" "$box"
    check_manual "$prefix" "$out"
    # shellcheck disable=SC2086
    gcc -std=c99 -O2 -g -Wall -Wextra -pedantic -Werror core/capi/tests/c/arrays.c $flags -lm -o "$out/arrays"
    cmake -S "$c" -B "$out/cmake" -DCMAKE_PREFIX_PATH="$prefix" >/dev/null
    cmake --build "$out/cmake" >/dev/null
    renders A env LD_LIBRARY_PATH="$lib" "$out/box" "$box" "$out/box.ppm"
    local threads
    for threads in 1 2 4 8; do
        renders B env LD_LIBRARY_PATH="$lib" "$out/threads" "$box" "$out/threads.ppm" $threads
        renders B env GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX2 LD_LIBRARY_PATH="$lib" \
            "$out/threads" "$box" "$out/threads.ppm" $threads
    done
    renders C env LD_LIBRARY_PATH="$lib" "$out/arrays"
    renders C env GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX2 LD_LIBRARY_PATH="$lib" "$out/arrays"
    check_full_disk
    renders A env LD_LIBRARY_PATH="$lib" python3 "$c/box.py" "$box" "$out/python.ppm"
    renders A "$out/static" "$box" "$out/static.ppm"
    renders A "$out/cmake/box" "$box" "$out/cmake.ppm"
    renders B "$out/cmake/threads" "$box" "$out/cmake.ppm"

    # one library for any x86-64: which build the loader takes, here, without AVX2, and on an emulated processor of 2008
    local loader=/lib64/ld-linux-x86-64.so.2 run=("$out/box" "$box" "$out/box.ppm") old=(qemu-x86_64 -cpu Nehalem)
    LD_LIBRARY_PATH=$lib "${run[@]}" 2>&1 >/dev/null | grep ', x86-64-v3$'
    GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX2 LD_LIBRARY_PATH=$lib "${run[@]}" 2>&1 >/dev/null | grep ', x86-64$'
    $loader --glibc-hwcaps-mask x86-64-v2 --library-path "$lib" "${run[@]}" 2>&1 >/dev/null | grep ', x86-64$'
    renders A "${old[@]}" -E LD_LIBRARY_PATH="$lib" "${run[@]}"
    { "${old[@]}" -E LD_LIBRARY_PATH="$fast" "${run[@]}" 2>&1 >/dev/null || [ $? = 1 ]; } | grep 'lacks instructions'

    # no leak, no byte that is not the program's, no decision by a byte that nobody has written
    local check=(valgrind --quiet --leak-check=full --show-leak-kinds=all --errors-for-leak-kinds=all --error-exitcode=9)
    renders A env LD_LIBRARY_PATH="$lib" "${check[@]}" "${run[@]}"
    renders B env LD_LIBRARY_PATH="$lib" "${check[@]}" "$out/threads" "$box" "$out/threads.ppm"
    renders C env LD_LIBRARY_PATH="$lib" "${check[@]}" "$out/arrays"

    check_overhead "$box"
    check_panics
}
