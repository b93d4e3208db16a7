//! stand-in until the filter lands

/// Planes.
#[derive(Clone, Copy, Debug)]
pub struct Noisy<'a> {
    pub size: [u32; 2],
    pub color: [&'a [f32]; 3],
    pub variance: [&'a [f32]; 3],
    pub albedo: [&'a [f32]; 3],
    pub normal: [&'a [f32]; 3],
}

pub fn scratch_len(_: [u32; 2]) -> usize {
    0
}

pub fn denoise(n: &Noisy<'_>, _: &mut [f32], out: [&mut [f32]; 3]) -> Result<(), ()> {
    let [w, h] = n.size.map(|x| x as i32);
    for (c, o) in out.into_iter().enumerate() {
        for y in 0..h {
            for x in 0..w {
                let (mut s, mut k) = (0.0, 0.0);
                for v in -2..=2 {
                    for u in -2..=2 {
                        let (a, b) = (x + u, y + v);
                        if a >= 0 && b >= 0 && a < w && b < h {
                            s += n.color[c][(b * w + a) as usize];
                            k += 1.0;
                        }
                    }
                }
                o[(y * w + x) as usize] = s / k;
            }
        }
    }
    Ok(())
}
