//! Coverage by material and object as Cryptomatte layers (Friedman and Jones, "Fully automatic ID mattes with support for
//! motion blur and transparency", SIGGRAPH Posters 2015; specification 1.2.0 of the files), by which compositing programs
//! pick things by name.
//!
//! A layer `CryptoObject00` has the channels R and B with identifiers, hashes of names whose bits are taken as floats, and G
//! and A with the shares of the pixel that they cover, largest first. Attributes of the file tell which hash belongs to
//! which name. Things with one name are one to Cryptomatte.

use crate::image::{Channel, Picture};
use std::collections::BTreeMap;

/// Adds the two ranks `[index, share, index, share]` as layer `{name}00`, with the attributes that readers need. `name_of`
/// names an index; the shares are those of the samples that hit something.
pub(crate) fn add(picture: &mut Picture, name: &str, ranks: &[Vec<f32>; 4], name_of: impl Fn(u32) -> String) {
    let mut hashes: BTreeMap<u32, u32> = BTreeMap::new();
    let mut manifest: BTreeMap<String, String> = BTreeMap::new();
    let mut hash = |index: f32, share: f32| {
        if share <= 0.0 {
            return 0.0;
        }
        let index = index as u32;
        let bits = *hashes.entry(index).or_insert_with(|| {
            let name = name_of(index);
            let bits = identifier(&name);
            manifest.insert(name, format!("{bits:08x}"));
            bits
        });
        f32::from_bits(bits)
    };
    let [id1, share1, id2, share2] = ranks;
    let mut ids = |ids: &[f32], shares: &[f32]| ids.iter().zip(shares).map(|(i, s)| hash(*i, *s)).collect::<Vec<_>>();
    let planes = [ids(id1, share1), share1.clone(), ids(id2, share2), share2.clone()];
    let channels = &mut picture.layer_mut(format!("{name}00")).channels;
    channels.extend(["R", "G", "B", "A"].iter().zip(planes).map(|(n, values)| Channel { name: (*n).into(), values }));
    let key = &format!("{:08x}", murmur3(name.as_bytes()))[..7];
    let manifest = ascii(&serde_json::to_string(&manifest).unwrap_or_default());
    let facts = [
        ("name", name.to_owned()),
        ("hash", "MurmurHash3_32".into()),
        ("conversion", "uint32_to_float32".into()),
        ("manifest", manifest),
    ];
    picture.attributes.extend(facts.map(|(fact, text)| (format!("cryptomatte/{key}/{fact}"), text)));
}

/// JSON without characters that EXR attributes cannot hold.
fn ascii(json: &str) -> String {
    let mut out = String::with_capacity(json.len());
    for c in json.chars() {
        match c.is_ascii() {
            true => out.push(c),
            false => c.encode_utf16(&mut [0; 2]).iter().for_each(|unit| out.push_str(&format!("\\u{unit:04x}"))),
        }
    }
    out
}

/// Bits of the float that stands for a name: its hash, with an exponent that is neither 0 nor that of infinities.
fn identifier(name: &str) -> u32 {
    let bits = murmur3(name.as_bytes());
    match bits >> 23 & 0xff {
        0 | 0xff => bits ^ 1 << 23,
        _ => bits,
    }
}

/// `MurmurHash3_x86_32` with seed 0 (Appleby; public domain).
fn murmur3(bytes: &[u8]) -> u32 {
    let scramble = |k: u32| k.wrapping_mul(0xcc9e_2d51).rotate_left(15).wrapping_mul(0x1b87_3593);
    let (words, rest) = bytes.as_chunks::<4>();
    let mut h = words.iter().fold(0u32, |h, word| {
        (h ^ scramble(u32::from_le_bytes(*word))).rotate_left(13).wrapping_mul(5).wrapping_add(0xe654_6b64)
    });
    let tail = rest.iter().rev().fold(0u32, |k, b| k << 8 | u32::from(*b));
    h ^= scramble(tail) ^ bytes.len() as u32;
    h = (h ^ h >> 16).wrapping_mul(0x85eb_ca6b);
    h = (h ^ h >> 13).wrapping_mul(0xc2b2_ae35);
    h ^ h >> 16
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Published values of the hash with seed 0, and the identifier that the Cryptomatte specification prints for the name
    /// `hello`. Killed by: a rotation or a constant that is another, a tail in the wrong order.
    #[test]
    fn hashes_are_those_of_the_specification() {
        let known = [("", 0), ("test", 0xba6b_d213), ("Hello, world!", 0xc036_3e43), ("hello", 0x248b_fa47)];
        for (text, hash) in known {
            assert_eq!(murmur3(text.as_bytes()), hash, "{text}");
        }
        assert_eq!(identifier("hello"), 0x248b_fa47);
        // no identifier is infinite, not a number or denormal
        assert!((0..200_000).all(|i| f32::from_bits(identifier(&i.to_string())).is_normal()));
    }

    /// Killed by: an index without coverage that is listed, a share in the place of an identifier, a manifest without the
    /// bits of the identifiers.
    #[test]
    fn layers_hold_hashes_and_shares() {
        let mut picture = Picture::new(2, 1);
        let ranks = [vec![3.0, -1.0], vec![0.75, 0.0], vec![5.0, -1.0], vec![0.25, 0.0]];
        add(&mut picture, "CryptoObject", &ranks, |i| format!("thing \"\u{1f3b2}{i}\""));
        let layer = picture.layer("CryptoObject00").unwrap();
        let bits = |c: &str| layer.channel(c).unwrap().iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits("R"), [identifier("thing \"\u{1f3b2}3\""), 0]);
        assert_eq!(bits("B"), [identifier("thing \"\u{1f3b2}5\""), 0]);
        assert_eq!((layer.channel("G").unwrap(), layer.channel("A").unwrap()), (&[0.75, 0.0][..], &[0.25, 0.0][..]));
        let facts: BTreeMap<_, _> = picture.attributes.iter().cloned().collect();
        let key = facts.keys().next().unwrap().rsplit_once('/').unwrap().0;
        assert_eq!((facts.len(), facts[&format!("{key}/name")].as_str()), (4, "CryptoObject"));
        let manifest: BTreeMap<String, String> = serde_json::from_str(&facts[&format!("{key}/manifest")]).unwrap();
        let listed =
            [3, 5].map(|i| format!("thing \"\u{1f3b2}{i}\"")).map(|n| (n.clone(), format!("{:08x}", identifier(&n))));
        assert_eq!(manifest, BTreeMap::from(listed));
        assert!(facts.values().all(|text| text.is_ascii()));
    }
}
