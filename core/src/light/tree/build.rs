//! Light trees from lights, in the caller's memory.
//!
//! A node takes the range of lights that it was given and splits it in two, always the part that costs most of those with
//! more than eight lights, until there are eight parts or none is that large. If there is room left, lights of smaller
//! parts become its children one by one, where all of a part find room. Splits are those with the least cost among twelve
//! places on each axis: weight times surface area of the box times solid angle that the lights emit into, regularised by
//! the shape of the box (Conty Estevez and Kulla 2018, section 4.1; equation 2). Parts of at most 64 lights are split at
//! multiples of eight, counted from either end, so that most of the lowest nodes are full, which halves the tree. Parts
//! that would make the tree too deep are halved. What the nodes say of their children is written afterwards
//! ([`light_node_of`]), by what edits use, too.

use super::extent::{Extent, Group, dot};
use crate::scene::Scene;
use crate::scene::blob::{CHILD_INDEX, LEAF_BIT, LightNode, MAX_LIGHT_DEPTH, NONE};
use bytemuck::Zeroable;

/// Places of a split on each axis.
const BINS: usize = 12;

/// Lights that two levels of nodes hold.
const FEW: usize = 64;

/// Memory of a tree in the making, see [`build_light_tree`].
#[derive(Debug)]
pub struct LightTree<'m> {
    /// Room for nodes: as many as lights are enough.
    pub nodes: &'m mut [LightNode],
    /// A trail per light.
    pub trails: &'m mut [u32],
    /// Scratch, an entry per light.
    pub order: &'m mut [u32],
}

/// Extents of single lights.
struct Lights<'a, 's> {
    scene: &'a Scene<'s>,
    /// Square of the scene's radius.
    square: f32,
    /// Least probability of being chosen by power.
    least: f32,
}

/// Probability of lights that are dark or hidden, while they find their places in the tree: they may shine later.
const DARK: f32 = 1e-10;

impl<'a, 's> Lights<'a, 's> {
    fn new(scene: &'a Scene<'s>, least: f32) -> Self {
        let side = |i: usize| {
            let [low, high] = [scene.info.bounds_min, scene.info.bounds_max].map(|p| p.get(i).copied().unwrap_or(0.0));
            high - low
        };
        let square = 0.25 * (side(0) * side(0) + side(1) * side(1) + side(2) * side(2));
        Self { scene, square: if square > 0.0 { square } else { 1.0 }, least }
    }

    fn get(&self, index: u32) -> Option<Extent> {
        let light = self.scene.lights.get(index as usize)?;
        let chosen = self.scene.light_alias.get(index as usize)?;
        Extent::of(self.scene, index, light, chosen.probability.max(self.least), self.square)
    }
}

/// Box, cone and weight of some lights, for costs.
#[derive(Clone, Copy)]
struct Sum {
    low: [f32; 3],
    high: [f32; 3],
    normals: [f32; 3],
    /// Some emit all around.
    round: bool,
    weight: f32,
    count: u32,
}

impl Sum {
    const EMPTY: Self =
        Self { low: [f32::MAX; 3], high: [-f32::MAX; 3], normals: [0.0; 3], round: false, weight: 0.0, count: 0 };

    fn one(e: &Extent) -> Self {
        let mut out = Self::EMPTY;
        for i in 0..3 {
            (out.low[i], out.high[i]) = (e.middle[i] - e.radius, e.middle[i] + e.radius);
            out.normals[i] = e.axis[i] * e.weight;
        }
        Self { round: e.cos < 0.0, weight: e.weight, count: 1, ..out }
    }

    fn add(&mut self, o: &Self) {
        for i in 0..3 {
            self.low[i] = self.low[i].min(o.low[i]);
            self.high[i] = self.high[i].max(o.high[i]);
            self.normals[i] += o.normals[i];
        }
        self.round |= o.round;
        self.weight += o.weight;
        self.count += o.count;
    }

    /// Weight times area of the box times solid angle that is lit, up to a factor. The spread of the normals is taken
    /// from the length of their mean: 1 if they are parallel.
    fn cost(&self) -> f32 {
        if self.count == 0 {
            return 0.0;
        }
        let [x, y, z] = [0, 1, 2].map(|i| self.high[i] - self.low[i]);
        let area = x * y + y * z + z * x;
        let parallel = dot(self.normals, self.normals) / (self.weight * self.weight).max(f32::MIN_POSITIVE);
        let lit = if self.round { 2.0 } else { 2.0 - parallel.min(1.0) };
        self.weight * area * lit
    }
}

struct Builder<'a, 'm, 's> {
    lights: Lights<'a, 's>,
    tree: LightTree<'m>,
    used: usize,
}

/// Lights that a node holds when its parts are halved from there on: 8 to the power of the levels below it, its own
/// included.
fn most(level: u32) -> usize {
    8usize.saturating_pow(MAX_LIGHT_DEPTH.saturating_sub(level))
}

impl Builder<'_, '_, '_> {
    /// The node of a range of the order; its index. `None` if there is no room.
    fn node(&mut self, from: usize, upto: usize, level: u32) -> Option<u32> {
        let index = self.used;
        *self.tree.nodes.get_mut(index)? = LightNode { child: [NONE; 8], ..Zeroable::zeroed() };
        self.used += 1;
        let mut parts = [(0, 0, -1.0f32); 8];
        let mut count = 1;
        parts[0] = (from, upto, 0.0);
        while count < 8 {
            // parts that do not fit into one node, then those whose lights all find room in this one
            let large = parts.iter().take(count).any(|(a, b, _)| b - a > 8);
            let may_split = |n: usize| if large { n > 8 } else { n > 1 && count + n - 1 <= 8 };
            let candidates = parts.iter().take(count).enumerate().filter(|(_, (a, b, _))| may_split(b - a));
            let halve = upto - from > most(level + 1);
            let of = |&(_, (a, b, cost)): &(usize, &(usize, usize, f32))| if halve { (b - a) as f32 } else { *cost };
            let Some((k, &(a, b, _))) = candidates.max_by(|x, y| of(x).total_cmp(&of(y))) else { break };
            let middle = if large { self.split(a, b, halve) } else { a + 1 };
            let [left, right] = [(a, middle), (middle, b)].map(|(a, b)| (a, b, self.sum(a, b).cost()));
            if let Some(place) = parts.get_mut(k) {
                *place = left;
            }
            if let Some(place) = parts.get_mut(count) {
                *place = right;
            }
            count += 1;
        }
        for (slot, &(a, b, _)) in parts.iter().take(count).enumerate() {
            let child =
                if b - a == 1 { LEAF_BIT | self.tree.order.get(a).copied()? } else { self.node(a, b, level + 1)? };
            *self.tree.nodes.get_mut(index)?.child.get_mut(slot)? = child;
        }
        Some(index as u32)
    }

    fn extent(&self, at: usize) -> Option<Extent> {
        self.lights.get(self.tree.order.get(at).copied()?)
    }

    fn sum(&self, from: usize, upto: usize) -> Sum {
        let mut sum = Sum::EMPTY;
        (from..upto).filter_map(|i| self.extent(i)).for_each(|e| sum.add(&Sum::one(&e)));
        sum
    }

    /// Brings those for which `first` holds to the front; how many there are, and where the rest begins.
    fn partition(&mut self, from: usize, upto: usize, first: impl Fn(&Extent) -> bool) -> usize {
        let mut next = from;
        for i in from..upto {
            if self.extent(i).is_some_and(|e| first(&e)) {
                self.tree.order.swap(i, next);
                next += 1;
            }
        }
        next
    }

    /// Parts a range of at least two; where the second part begins.
    fn split(&mut self, from: usize, upto: usize, halve: bool) -> usize {
        let half = from + (upto - from) / 2;
        // lights at infinity have no place: they come first
        let infinite = self.partition(from, upto, |e| !e.radius.is_finite());
        if infinite > from {
            return if infinite < upto { infinite } else { half };
        }
        let (mut low, mut high) = ([f32::MAX; 3], [-f32::MAX; 3]);
        for e in (from..upto).filter_map(|i| self.extent(i)) {
            for i in 0..3 {
                (low[i], high[i]) = (low[i].min(e.middle[i]), high[i].max(e.middle[i]));
            }
        }
        let side = [0, 1, 2].map(|i| high[i] - low[i]);
        let longest = side.into_iter().fold(0.0, f32::max);
        let bin = |axis: usize, e: &Extent| {
            (((e.middle[axis] - low[axis]) / side[axis] * BINS as f32) as usize).min(BINS - 1)
        };
        if upto - from <= FEW && !halve {
            return self.split_few(from, upto, side, longest).unwrap_or(half);
        }
        let mut best: Option<(f32, usize, usize)> = None;
        for axis in (0..3).filter(|a| side[*a] > 0.0 && !halve) {
            let mut bins = [Sum::EMPTY; BINS];
            for e in (from..upto).filter_map(|i| self.extent(i)) {
                if let Some(sum) = bins.get_mut(bin(axis, &e)) {
                    sum.add(&Sum::one(&e));
                }
            }
            for place in 1..BINS {
                let of = |bins: &[Sum]| {
                    let mut sum = Sum::EMPTY;
                    bins.iter().for_each(|b| sum.add(b));
                    sum
                };
                let (below, above) = bins.split_at_checked(place).unwrap_or((&[], &[]));
                let (below, above) = (of(below), of(above));
                let cost = (below.cost() + above.cost()) * longest / side[axis];
                if below.count > 0 && above.count > 0 && best.is_none_or(|(least, ..)| cost < least) {
                    best = Some((cost, axis, place));
                }
            }
        }
        let Some((_, axis, place)) = best else { return half };
        let middle = self.partition(from, upto, |e| bin(axis, e) < place);
        if middle > from && middle < upto { middle } else { half }
    }

    /// Parts at most [`FEW`] lights at a multiple of eight from either end, so that nodes below are full; where the second
    /// part begins. `None` if they fit into one node, or all have one place.
    fn split_few(&mut self, from: usize, upto: usize, side: [f32; 3], longest: f32) -> Option<usize> {
        let mut lights = [(0, [0.0; 3], Sum::EMPTY); FEW];
        let lights = lights.get_mut(..upto - from)?;
        for (light, at) in lights.iter_mut().zip(from..upto) {
            let e = self.extent(at)?;
            *light = (self.tree.order.get(at).copied()?, e.middle, Sum::one(&e));
        }
        let sort = |lights: &mut [(u32, [f32; 3], Sum)], axis: usize| {
            lights.sort_unstable_by(|(i, a, _), (j, b, _)| a[axis].total_cmp(&b[axis]).then(i.cmp(j)));
        };
        let cost_of = |lights: &[(u32, [f32; 3], Sum)]| {
            let mut sum = Sum::EMPTY;
            lights.iter().for_each(|(_, _, one)| sum.add(one));
            sum.cost()
        };
        let mut best: Option<(f32, usize, usize)> = None;
        for axis in (0..3).filter(|a| side[*a] > 0.0) {
            sort(lights, axis);
            let n = lights.len();
            for place in (8..n).step_by(8).flat_map(|k| [k, n - k]) {
                let (below, above) = lights.split_at_checked(place)?;
                let cost = (cost_of(below) + cost_of(above)) * longest / side[axis];
                if best.is_none_or(|(least, ..)| cost < least) {
                    best = Some((cost, axis, place));
                }
            }
        }
        let (_, axis, place) = best?;
        sort(lights, axis);
        let order = self.tree.order.get_mut(from..upto)?;
        order.iter_mut().zip(lights).for_each(|(place, (index, ..))| *place = *index);
        Some(from + place)
    }
}

/// Builds the tree over the lights of a scene, of which those that are never chosen by power weigh nothing; how many
/// nodes it has, 0 without lights or without an alias table. `None` if the memory does not suffice: nodes, trails and
/// scratch for each light always do.
pub fn build_light_tree(scene: &Scene<'_>, tree: LightTree<'_>) -> Option<usize> {
    let lights = Lights::new(scene, DARK);
    let (n, LightTree { nodes, trails, order }) = (scene.lights.len(), tree);
    if trails.len() < n || order.len() < n || n > CHILD_INDEX as usize {
        return None;
    }
    trails.fill(NONE);
    let mut count = 0;
    for index in 0..n as u32 {
        if lights.get(index).is_some() {
            *order.get_mut(count)? = index;
            count += 1;
        }
    }
    if count == 0 {
        return Some(0);
    }
    let mut builder = Builder { lights, tree: LightTree { nodes, trails, order }, used: 0 };
    builder.node(0, count, 0)?;
    let Builder { tree: LightTree { nodes, trails, .. }, used, .. } = builder;
    let nodes = nodes.get_mut(..used)?;
    leave_trails(nodes, trails, 0, 0, 0);
    for index in 0..nodes.len() {
        let node = light_node_of(scene, nodes, index)?;
        *nodes.get_mut(index)? = node;
    }
    Some(used)
}

/// Writes the trails of the lights below a node, whose own is `trail`.
fn leave_trails(nodes: &[LightNode], trails: &mut [u32], index: u32, trail: u32, level: u32) {
    let Some(node) = nodes.get(index as usize).filter(|_| level < MAX_LIGHT_DEPTH) else { return };
    for (slot, child) in (0u32..).zip(node.child).filter(|(_, c)| *c != NONE) {
        let trail = trail | slot << (3 * level);
        if child & LEAF_BIT == 0 {
            leave_trails(nodes, trails, child, trail, level + 1);
        } else if let Some(place) = trails.get_mut((child & CHILD_INDEX) as usize) {
            *place = trail;
        }
    }
}

/// Calls `f` with the lights of a child.
fn each_light(nodes: &[LightNode], child: u32, level: u32, f: &mut dyn FnMut(u32)) {
    if child == NONE || level > MAX_LIGHT_DEPTH {
        return;
    }
    if child & LEAF_BIT != 0 {
        return f(child & CHILD_INDEX);
    }
    let Some(node) = nodes.get(child as usize) else { return };
    node.child.iter().for_each(|c| each_light(nodes, *c, level + 1, f));
}

/// What node `index` says of its children, for the lights as they are in `scene`, with the children that it has. `None`
/// without such a node. Takes a time in proportion to the lights below it.
pub fn light_node_of(scene: &Scene<'_>, nodes: &[LightNode], index: usize) -> Option<LightNode> {
    let lights = Lights::new(scene, 0.0);
    let child = nodes.get(index)?.child;
    let mut out = LightNode { child, ..Zeroable::zeroed() };
    for (slot, child) in child.into_iter().enumerate().filter(|(_, c)| *c != NONE) {
        let mut extent = None;
        if child & LEAF_BIT != 0 {
            extent = lights.get(child & CHILD_INDEX);
        } else {
            let mut group = Group::EMPTY;
            each_light(nodes, child, 1, &mut |i| lights.get(i).iter().for_each(|e| group.add(e)));
            let mut whole = group.begin();
            each_light(nodes, child, 1, &mut |i| lights.get(i).iter().for_each(|e| Group::reach(&mut whole, e)));
            extent = Some(whole).filter(|e| e.weight > 0.0).or(extent);
        }
        // dark: importance 0
        let Some(e) = extent else { continue };
        for axis in 0..3 {
            (out.middle[axis][slot], out.axis[axis][slot]) = (e.middle[axis], e.axis[axis]);
        }
        (out.radius[slot], out.front[slot], out.weight[slot]) = (e.radius, e.front, e.weight);
        (out.cos[slot], out.sin[slot]) = (e.cos, e.sin);
    }
    Some(out)
}
