//! Numbering of pixels, of the square blocks that they lie in, and of the tiles that shards own.
//!
//! Pixels count row by row from the top left: the *film index*. Blocks count row by row as well; those at the right and
//! lower border are cut off. Tiles are blocks of [`TILE`] pixels a side, and their slots count in Morton order.

/// Side of a tile, pixels.
pub(crate) const TILE: u32 = 8;
/// Pixel slots of a tile; slots outside the picture stay empty.
pub(crate) const TILE_PIXELS: u32 = TILE * TILE;

/// Film index of a pixel of a picture with `size` columns and rows.
#[inline]
pub(crate) fn film_index(size: [u32; 2], [x, y]: [u32; 2]) -> usize {
    y as usize * size[0] as usize + x as usize
}

/// Column and row of the pixel with a film index.
#[inline]
pub(crate) fn pixel_at(size: [u32; 2], film: u32) -> [u32; 2] {
    let columns = size[0].max(1);
    [film % columns, film / columns]
}

/// Division of a picture into square blocks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BlockGrid {
    size: [u32; 2],
    side: u32,
    columns: u32,
    rows: u32,
}

impl BlockGrid {
    /// Blocks of `side` pixels, at least 1, of a picture with `size` columns and rows.
    #[inline]
    pub(crate) fn new(size: [u32; 2], side: u32) -> Self {
        let side = side.max(1);
        let [columns, rows] = size.map(|n| n.div_ceil(side));
        Self { size, side, columns, rows }
    }

    /// Tiles of a picture with `size` columns and rows.
    #[inline]
    pub(crate) fn tiles(size: [u32; 2]) -> Self {
        Self::new(size, TILE)
    }

    /// Number of blocks.
    #[inline]
    pub(crate) fn count(self) -> usize {
        self.columns as usize * self.rows as usize
    }

    /// Number of the block around the pixel with a film index.
    #[inline]
    pub(crate) fn of_pixel(self, film: u32) -> u32 {
        let ([x, y], side) = (pixel_at(self.size, film), self.side.max(1));
        y / side * self.columns + x / side
    }

    /// First column and row of a block.
    #[inline]
    fn start(self, block: u32) -> [u32; 2] {
        let columns = self.columns.max(1);
        [block % columns * self.side, block / columns * self.side]
    }

    /// First column and row of a block, and those behind its last.
    pub(crate) fn corners(self, block: u32) -> [[u32; 2]; 2] {
        let from = self.start(block);
        [from, [0, 1].map(|a| (from[a] + self.side).min(self.size[a]))]
    }

    /// Number of pixels in a block.
    pub(crate) fn area(self, block: u32) -> u32 {
        let [from, to] = self.corners(block);
        (to[0] - from[0]) * (to[1] - from[1])
    }
}

/// Assignment of a picture's tiles to shards, interleaved so that neighbours in both directions differ.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tiles {
    size: [u32; 2],
    columns: u32,
    rows: u32,
    shards: u32,
    /// Tiles to skip per row, so that a column does not belong to one shard.
    skew: u32,
}

/// Greatest common divisor.
fn greatest_divisor(a: u32, b: u32) -> u32 {
    let (mut a, mut b) = (a, b);
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}

/// Bits 0, 2, 4 of `x`, packed.
const fn even_bits(x: u32) -> u32 {
    x & 1 | x >> 1 & 2 | x >> 2 & 4
}

/// Column and row of each slot within its tile.
const SLOTS: [[u8; 2]; TILE_PIXELS as usize] = {
    let mut slots = [[0; 2]; TILE_PIXELS as usize];
    let mut i = 0;
    while i < TILE_PIXELS {
        slots[i as usize] = [even_bits(i) as u8, even_bits(i >> 1) as u8];
        i += 1;
    }
    slots
};

impl Tiles {
    pub(crate) fn new(size: [u32; 2], shards: u32) -> Self {
        // near the golden section of the shard count: rows start far apart
        let skew = (f64::from(shards) * 0.618_034) as u32;
        let BlockGrid { columns, rows, .. } = BlockGrid::tiles(size);
        Self { size, columns, rows, shards, skew }
    }

    /// First column of tiles at or after `from`, in row `y` of tiles, that belongs to `shard`; it may be beyond the row.
    /// Column x belongs to shard (x + y skew) mod shards.
    fn next_in_row(&self, shard: u32, from: u32, y: u32) -> u64 {
        let shards = u64::from(self.shards.max(1));
        let owner = (u64::from(from) + u64::from(y) * u64::from(self.skew.max(1))) % shards;
        u64::from(from) + (u64::from(shard) + shards - owner) % shards
    }

    /// First tile of `shard` at or after `tile`. The time depends on the rows of tiles between them.
    pub(crate) fn next_of(&self, shard: u32, tile: u32) -> Option<u32> {
        if shard >= self.shards {
            return None;
        }
        let (mut from, first) = (tile % self.columns.max(1), tile / self.columns.max(1));
        for y in first..self.rows {
            let x = self.next_in_row(shard, from, y);
            if x < u64::from(self.columns) {
                return Some(y * self.columns + x as u32);
            }
            from = 0;
        }
        None
    }

    /// Number of tiles, of all shards.
    pub(crate) fn count(&self) -> usize {
        self.columns as usize * self.rows as usize
    }

    /// Number of pixels, of all shards.
    pub(crate) fn pixels(&self) -> u64 {
        u64::from(self.size[0]) * u64::from(self.size[1])
    }

    /// Number of pixels that `shard` owns.
    pub(crate) fn pixels_of(&self, shard: u32) -> usize {
        let last = self.columns.saturating_sub(1);
        let wide = |x: u64| if x == u64::from(last) { self.size[0] - last * TILE } else { TILE };
        let row = |y: u32| {
            let x = self.next_in_row(shard, 0, y);
            let columns = u64::from(self.columns);
            let tiles = if x < columns { (columns - x).div_ceil(u64::from(self.shards)) } else { 0 };
            // all but the last tile of the picture are as wide as tiles are
            let end = x + tiles.saturating_sub(1) * u64::from(self.shards);
            let pixels = if tiles == 0 { 0 } else { (tiles - 1) * u64::from(TILE) + u64::from(wide(end)) };
            pixels * u64::from(TILE.min(self.size[1] - y * TILE))
        };
        if shard < self.shards { (0..self.rows).map(row).sum::<u64>() as usize } else { 0 }
    }

    /// Upper bound of the pixels that a shard owns.
    pub(crate) fn most_pixels(&self) -> usize {
        // Per row of tiles the owners run through all shards in turn. In as many rows as the skew takes to come back to
        // the first shard, every shard of its residue class is the first of one row.
        let (columns, rows, skew) = (self.columns as usize, self.rows as usize, self.skew.max(1));
        let class = greatest_divisor(skew, self.shards).max(1);
        let of_row = columns.div_ceil(self.shards as usize);
        let (period, of_period) = ((self.shards / class) as usize, columns.div_ceil(class as usize));
        let rest = (rows % period).saturating_mul(of_row).min(of_period);
        let by_row = rows.saturating_mul(of_row);
        let by_period = (rows / period).saturating_mul(of_period).saturating_add(rest);
        let [w, h] = self.size.map(|n| n.min(TILE) as usize);
        by_row.min(by_period).saturating_mul(w * h).min(self.size[0] as usize * self.size[1] as usize)
    }

    /// First column and row of a tile.
    pub(crate) fn start(&self, tile: u32) -> [u32; 2] {
        let columns = self.columns.max(1);
        [tile % columns * TILE, tile / columns * TILE]
    }

    /// Column and row of slot `slot` (Morton order) of the tile that starts at `[x, y]`, if inside the picture.
    #[inline]
    pub(crate) fn pixel(&self, [x, y]: [u32; 2], slot: u32) -> Option<[u32; 2]> {
        let [dx, dy] = SLOTS[(slot % TILE_PIXELS) as usize].map(u32::from);
        let (x, y) = (x + dx, y + dy);
        (x < self.size[0] && y < self.size[1]).then_some([x, y])
    }

    /// Number of pixels in a tile.
    pub(crate) fn area(&self, tile: u32) -> u32 {
        BlockGrid::tiles(self.size).area(tile)
    }

    /// Film index of a pixel.
    pub(crate) fn film_index(&self, pixel: [u32; 2]) -> usize {
        film_index(self.size, pixel)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::vec;
    use std::vec::Vec;

    /// Shards, slots, corners and the block around a pixel number tiles alike; every pixel is one shard's, once. Killed
    /// by: columns and rows exchanged, a border that is not cut off, a slot of another order, a tile of two shards.
    #[test]
    fn all_numberings_agree() {
        for size in [[1, 1], [8, 8], [17, 9], [3, 40], [64, 33]] {
            for shards in [1, 2, 3, 7] {
                let (tiles, grid) = (Tiles::new(size, shards), BlockGrid::tiles(size));
                let mut seen = vec![0; (size[0] * size[1]) as usize];
                let mut owned = 0;
                for shard in 0..shards {
                    let (mut of_shard, mut pixels) = (0, 0);
                    let mut next = tiles.next_of(shard, 0);
                    while let Some(tile) = next {
                        let [from, to] = grid.corners(tile);
                        let mut inside = 0;
                        for [x, y] in (0..TILE_PIXELS).filter_map(|slot| tiles.pixel(tiles.start(tile), slot)) {
                            let film = tiles.film_index([x, y]);
                            assert_eq!(pixel_at(size, film as u32), [x, y]);
                            assert_eq!(grid.of_pixel(film as u32), tile, "{size:?}");
                            assert!((from[0]..to[0]).contains(&x) && (from[1]..to[1]).contains(&y));
                            seen[film] += 1;
                            inside += 1;
                        }
                        assert_eq!(grid.area(tile), inside);
                        pixels += inside as usize;
                        of_shard += 1;
                        next = tiles.next_of(shard, tile + 1);
                    }
                    assert_eq!(pixels, tiles.pixels_of(shard), "{size:?}, {shard} of {shards}");
                    assert!(pixels <= tiles.most_pixels());
                    owned += of_shard;
                }
                assert!(seen.iter().all(|n| *n == 1));
                assert_eq!(owned, grid.count());
            }
        }
    }

    /// Pictures of one column or row, more shards than tiles. Killed by: a slot for each pixel of a tile that is cut off,
    /// a bound by the rows.
    #[test]
    fn shards_own_their_share_of_odd_pictures() {
        for (size, shards) in
            [([1, 65_536], 256), ([65_536, 1], 256), ([1, 65_536], 65_536), ([9, 9], 300), ([1920, 1080], 64)]
        {
            let tiles = Tiles::new(size, shards);
            let owned: Vec<usize> = (0..shards).map(|s| tiles.pixels_of(s)).collect();
            let (all, most) = ((size[0] * size[1]) as usize, tiles.most_pixels());
            assert_eq!(owned.iter().sum::<usize>(), all);
            let largest = owned.iter().max().unwrap();
            assert!(most >= *largest && most <= largest + 64.max(largest / 16), "{size:?}: {most} for {largest}");
            assert_eq!((tiles.pixels_of(shards), tiles.next_of(shards, 0)), (0, None));
        }
    }

    /// Blocks of any side cover the picture once. Killed by: a side that is taken for that of tiles.
    #[test]
    fn blocks_of_any_side_cover_the_picture() {
        for side in [1, 3, 8, 50] {
            let grid = BlockGrid::new([20, 7], side);
            let areas: u32 = (0..grid.count() as u32).map(|b| grid.area(b)).sum();
            assert_eq!(areas, 140);
            for film in 0..140 {
                let ([x, y], [from, to]) = (pixel_at([20, 7], film), grid.corners(grid.of_pixel(film)));
                assert!((from[0]..to[0]).contains(&x) && (from[1]..to[1]).contains(&y), "side {side}");
            }
        }
    }
}
