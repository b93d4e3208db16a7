//! Which pixels belong to which shard: square tiles, dealt out so that neighbours in both directions differ.

/// Pixels along a tile's side.
pub(crate) const TILE: u32 = 8;
/// Pixel slots of a tile; slots outside the picture stay empty.
pub(crate) const TILE_PIXELS: u32 = TILE * TILE;

/// The tiles of a picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tiles {
    size: [u32; 2],
    columns: u32,
    rows: u32,
    shards: u32,
    /// Tiles to skip per row, so that a column does not belong to one shard.
    skew: u32,
}

/// Bits 0, 2, 4 of `x`, packed.
fn even_bits(x: u32) -> u32 {
    x & 1 | x >> 1 & 2 | x >> 2 & 4
}

impl Tiles {
    pub(crate) fn new(size: [u32; 2], shards: u32) -> Self {
        // near the golden section of the shard count: rows start far apart
        let skew = (f64::from(shards) * 0.618_034) as u32;
        Self { size, columns: size[0].div_ceil(TILE), rows: size[1].div_ceil(TILE), shards, skew }
    }

    fn owner(&self, tile: u32) -> u32 {
        let (x, y) = (tile % self.columns, tile / self.columns);
        ((u64::from(x) + u64::from(y) * u64::from(self.skew.max(1))) % u64::from(self.shards)) as u32
    }

    /// The first tile of `shard` at or after `tile`.
    pub(crate) fn next_of(&self, shard: u32, tile: u32) -> Option<u32> {
        (tile..self.columns * self.rows).find(|&t| self.owner(t) == shard)
    }

    /// How many tiles a shard owns at the most.
    pub(crate) fn most_tiles(&self) -> usize {
        // per row of tiles the owners run through all shards in turn
        (self.rows as usize).saturating_mul(self.columns.div_ceil(self.shards) as usize)
    }

    /// Picture coordinates of slot `slot` of `tile` (Morton order), if inside the picture.
    pub(crate) fn pixel(&self, tile: u32, slot: u32) -> Option<[u32; 2]> {
        let x = tile % self.columns * TILE + even_bits(slot);
        let y = tile / self.columns * TILE + even_bits(slot >> 1);
        (x < self.size[0] && y < self.size[1]).then_some([x, y])
    }

    /// Index of a pixel in the film.
    pub(crate) fn film_index(&self, [x, y]: [u32; 2]) -> usize {
        y as usize * self.size[0] as usize + x as usize
    }
}
