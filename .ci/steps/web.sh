# Steps of .ci/run: what a browser shows.
# shellcheck shell=bash

# Chromium, Node and what drives them.
need_browser() {
    local missing=()
    [ -n "${CHROMIUM-}" ] || command -v chromium >/dev/null || missing+=(chromium)
    command -v node >/dev/null || missing+=(nodejs)
    command -v npm >/dev/null || missing+=(npm)
    [ ${#missing[@]} -eq 0 ] || packages "${missing[@]}"
    # one step at a time, and not while another uses what is there
    (
        flock 9
        [ embed-example/web/node_modules/.package-lock.json -nt embed-example/web/package-lock.json ] ||
            npm ci --prefix embed-example/web --ignore-scripts --no-audit --no-fund
    ) 9>"$target/npm.lock"
}

# The page of embed-example/web: sizes, imports and the picture's hash of its modules and its worker in Node; the page itself
# in headless Chromium, which prints frames per second. Pictures of it, to be looked at, go to target/web-shots.
step_web() {
    need_debian_rust
    need_browser
    CARGO_TARGET_DIR=$target/web CROUPIER_WEB_DEBIAN=1 embed-example/web/build
    node embed-example/web/test/module.mjs
    node embed-example/web/test/worker.mjs
    node embed-example/web/test/browser.mjs "$target/web-shots"
}

# The page of `croupier report`, from next to no measurements: made from its ledger it is the same again, and a browser
# shows all of its figures. Pictures of it, to be looked at, go to target/report-shots.
step_report() {
    need_browser
    # without LTO: what the page shows of speed does not matter here
    local program=(cargo run -p croupier-host --bin croupier -- report)
    rm -rf "$target/report" "$target/report-again"
    "${program[@]}" --tiny --out "$target/report"
    "${program[@]}" --ledger "$target/report/ledger.json" --out "$target/report-again"
    diff -r "$target/report" "$target/report-again"
    node embed-example/web/test/report.mjs "$target/report" "$target/report-shots/tiny"
    node embed-example/web/test/report.mjs benches/results/report "$target/report-shots/committed"
}
