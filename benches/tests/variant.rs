//! Rows of the tables are what their names say.

use croupier::{Plan, Settings, Strategy};
use croupier_benches::variant::Variant;
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::builtin;

/// What `+small` takes beside scene and film for a picture of usual size, vertices and pixel estimates included. Killed
/// by: a cache, ledger or ring that does not fit.
#[test]
fn small_is_256_kib() {
    let baked = bake(&builtin::cornell_box(), &BakeOptions::default(), |_, _| {}).unwrap();
    let scene = croupier::Scene::from_bytes(&baked.bytes).unwrap();
    let of = |s: Settings| {
        let plan = Plan::new(&Settings { size: [640, 480], shards: 1, ..s }).unwrap();
        plan.session().size + plan.shard().size
    };
    let film = of(Settings { strategy: Strategy::parse("none").unwrap(), ring: 16, ..Settings::for_scene(&scene) });
    for name in ["ears+small", "ears+small+shadow", "ears+small+auto", "adrrs+small"] {
        let all = of(Variant::parse(name).unwrap().apply(Settings::for_scene(&scene)));
        assert!(all - film <= 256 << 10, "{name}: {} bytes", all - film);
    }
}
