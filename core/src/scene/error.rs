//! Errors of scene validation: the object, its index and the number that is wrong.

use super::blob::{MAX_CONDITION, MAX_SHAPE_LIGHTS, MAX_TREE_DEPTH, SectionKind, VERSION};
use super::instances::InstanceFault;
use crate::instructions::INSTRUCTION_SET;
use core::fmt;

/// A number of a record that must lie in a stated range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Field {
    /// A coordinate: finite, at most [`super::blob::MAX_COORDINATE`] from 0.
    Position,
    /// A component or, as the squared length, the unit length of a direction.
    Direction,
    /// A texture coordinate, limited like a position.
    TextureCoordinate,
    /// Bounds: smallest not above largest, and around every triangle.
    Bounds,
    /// Reflectance or tabulated transmittance, [`super::blob::REFLECTANCE_RANGE`].
    Reflectance,
    /// GGX width, [`super::blob::ALPHA_RANGE`].
    Alpha,
    /// Refractive index: relative, [`super::blob::ETA_RANGE`]; of a conductor, [`super::blob::CONDUCTOR_RANGE`].
    Eta,
    /// Extinction of a conductor, [`super::blob::CONDUCTOR_RANGE`]; the larger of it and eta from
    /// [`super::blob::MIN_CONDUCTOR`].
    Extinction,
    /// Internal diffuse reflectance, [`super::blob::FDR_RANGE`].
    InternalReflectance,
    /// Tabulated factor or energy of compensation, [`super::blob::COMPENSATION_RANGE`], [`super::blob::ENERGY_RANGE`].
    Compensation,
    /// Emission, 0 to [`super::blob::MAX_EMISSION`].
    Emission,
    /// 1 - cosine of the half angle of a light's cone (outer above 0 up to 2, inner from 0 to the outer one) or disk
    /// (above 0 up to 1).
    Cone,
    /// Area, above 0 and that of the light's triangle within 1e-3.
    Area,
    /// Probability, 0 to 1.
    Probability,
    /// Columns of an image, 1 to [`super::blob::MAX_SIDE`].
    Width,
    /// Rows of an image, 1 (environment map: 2) to [`super::blob::MAX_SIDE`].
    Height,
    /// Lens radius, from 0; 0 for other projections than perspective.
    LensRadius,
    /// Distance in focus, above 0 if there is a lens.
    FocusDistance,
    /// Volume spanned by the camera's three axes over the product of their lengths, away from 0.
    ImagePlane,
    /// Absorption coefficient, 0 to [`super::blob::MAX_COEFFICIENT`].
    Absorption,
    /// Scattering coefficient, 0 to [`super::blob::MAX_COEFFICIENT`].
    Scattering,
    /// Mean cosine of a phase function, as a magnitude up to [`super::blob::MAX_ANISOTROPY`].
    Anisotropy,
    /// Cells of a grid along one axis, 1 to [`super::blob::MAX_SIDE`].
    Cells,
    /// Density of a grid, 0 to [`super::blob::MAX_COEFFICIENT`].
    Density,
    /// Majorant, from [`super::blob::MAJORANT_MARGIN`] times the largest density that it covers to
    /// [`super::blob::MAX_MAJORANT`].
    Majorant,
    /// Width of the distribution of a sheen's fibres, [`super::blob::SHEEN_RANGE`].
    SheenWidth,
    /// Scale of a normal map, as a magnitude up to [`super::blob::MAX_NORMAL_SCALE`].
    NormalScale,
    /// Condition of an object: the largest of its instances.
    Condition,
    /// Radius, or length of half an edge, of a light with a shape, [`super::blob::SHAPE_SIZE_RANGE`].
    ShapeSize,
    /// Squared cosine between the edges of a rectangle, up to 1e-6.
    Edges,
}

impl Field {
    /// Name of the field.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::Direction => "direction (or its squared length)",
            Self::TextureCoordinate => "texture coordinate",
            Self::Bounds => "bound",
            Self::Reflectance => "reflectance",
            Self::Alpha => "alpha",
            Self::Eta => "eta",
            Self::Extinction => "k",
            Self::InternalReflectance => "fdr",
            Self::Compensation => "compensation",
            Self::Emission => "emission",
            Self::Cone => "1 - cosine of a cone",
            Self::Area => "area",
            Self::Probability => "probability",
            Self::Width => "width",
            Self::Height => "height",
            Self::LensRadius => "lens radius",
            Self::FocusDistance => "focus distance",
            Self::ImagePlane => "image plane",
            Self::Absorption => "sigma_a",
            Self::Scattering => "sigma_s",
            Self::Anisotropy => "g",
            Self::Cells => "number of cells along an axis",
            Self::Density => "density",
            Self::Majorant => "majorant",
            Self::SheenWidth => "width of the sheen",
            Self::NormalScale => "normal scale",
            Self::Condition => "condition",
            Self::ShapeSize => "radius or length of half an edge",
            Self::Edges => "squared cosine between the edges",
        }
    }
}

/// Fault of an entry of the section table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SectionFault {
    /// Two sections of this kind.
    Repeated,
    /// Bytes per record.
    Stride(u32),
    /// Not a multiple of [`super::blob::ALIGN`], or inside the header and table.
    Offset(u64),
    /// Records: too many for the blob or for 31-bit indices, or not the number that other sections call for.
    Count(u64),
    /// Shares bytes with another section.
    Overlaps(SectionKind),
}

/// Fault of a child slot of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ChildFault {
    /// An unused slot whose box is not (+inf, -inf).
    EmptyBox(f32),
    /// A box with a bound that is not finite, or above its opposite.
    Bounds(f32),
    /// A bound outside the parent's box (of the root: outside the scene's bounds).
    Outside(f32),
    /// A node or leaf that is not the next in depth-first order; excludes cycles and sharing.
    Order {
        /// The next unvisited index.
        expected: u32,
        /// The reference's index.
        found: u32,
    },
    /// A leaf of no or more than eight triangles.
    Count(u32),
    /// A node deeper than [`MAX_TREE_DEPTH`].
    Deep,
}

/// Fault of a triangle slot of a leaf.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum SlotFault {
    /// Beyond the leaf's count, but not zeros and [`super::blob::NONE`].
    Unused,
    /// A coordinate that is not the triangle's vertex.
    Vertex(f32),
    /// A coordinate outside the leaf's box.
    Outside(f32),
}

/// Fault of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ObjectFault {
    /// Its triangles, nodes, leaves or instances are not the run behind those of the object before, or not within their
    /// sections; of an object that does not exist: something is left over.
    Order,
    /// It holds nothing, is a world without instances, or has things without a tree or a tree without things.
    Empty,
    /// Emitting triangles, or lights in all, that are not as many as there are.
    Lights(u32),
    /// Its top-level tree does not hold each of its instances, and the tree of its triangles, exactly once.
    Coverage {
        /// Instances that it has.
        instances: u32,
        /// Instances and trees met.
        met: u32,
    },
}

/// Error of scene validation.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum SceneError {
    /// The processor lacks instructions that this build uses ([`crate::INSTRUCTION_SET`]): nothing was read.
    Instructions {
        /// The first set that is missing.
        missing: &'static str,
    },
    /// Fewer bytes than needed.
    Truncated {
        /// Bytes needed.
        needed: u64,
        /// Bytes given.
        given: u64,
    },
    /// The first bytes are not `CROUPIER`.
    Magic,
    /// Made by another version.
    Version(u32),
    /// The bytes must start at a multiple of 4.
    Misaligned,
    /// The content is not what was written.
    Hash {
        /// Hash in the header.
        stated: u64,
        /// Hash of the bytes.
        found: u64,
    },
    /// More sections than there are kinds.
    SectionCount(u32),
    /// A section of unknown kind.
    UnknownSection(u32),
    /// A section with an impossible offset, stride or count.
    Section {
        /// Kind of the section.
        kind: SectionKind,
        /// Fault of the section.
        fault: SectionFault,
    },
    /// The header's reserved bytes are not 0.
    Header,
    /// Reserved or unused bits that are not 0.
    Reserved {
        /// Section.
        of: SectionKind,
        /// Record.
        index: u32,
    },
    /// A kind that does not exist.
    Kind {
        /// Section.
        of: SectionKind,
        /// Record.
        index: u32,
        /// Number found.
        found: u32,
    },
    /// A reference that is out of range, missing, or not answered by the object it names.
    Reference {
        /// Section.
        of: SectionKind,
        /// Record.
        index: u32,
        /// Section referred to.
        to: SectionKind,
        /// Index found there.
        found: u32,
        /// Records there.
        count: u32,
    },
    /// A number out of its range (see [`Field`]).
    Number {
        /// Section.
        of: SectionKind,
        /// Record.
        index: u32,
        /// Field of the record.
        field: Field,
        /// Value found.
        found: f32,
    },
    /// A node's child slot.
    Child {
        /// Node.
        node: u32,
        /// Slot, 0 to 7.
        slot: u32,
        /// Fault of the child slot.
        fault: ChildFault,
    },
    /// A leaf's triangle slot.
    Slot {
        /// Leaf.
        leaf: u32,
        /// Slot, 0 to 7.
        slot: u32,
        /// Fault of the triangle slot.
        fault: SlotFault,
    },
    /// An object.
    Object {
        /// Object; 0 is the world.
        object: u32,
        /// Fault of the object.
        fault: ObjectFault,
    },
    /// An instance.
    Instance {
        /// Instance.
        instance: u32,
        /// Fault of the instance.
        fault: InstanceFault,
    },
    /// Records that the walk from the root does not reach, or a childless node.
    Unreached {
        /// Nodes or leaves.
        of: SectionKind,
        /// Index of the first one.
        index: u32,
    },
    /// The leaves do not hold every triangle exactly once.
    Coverage {
        /// Triangles.
        triangles: u32,
        /// Triangle slots in use over all leaves.
        slots: u64,
    },
    /// An alias table whose thresholds do not give the stated probabilities.
    AliasTable {
        /// Section.
        of: SectionKind,
        /// First entry of the table.
        first: u32,
        /// Length of the table.
        length: u32,
        /// Sum over the items of (stated - actual) / stated probability, each weighed by up to +-1.
        deviation: f32,
    },
    /// A light with a shape that is followed by a light without one, or by too many of its like.
    ShapeLights {
        /// Light.
        light: u32,
    },
    /// Names are not UTF-8 with a line for each material at least.
    Names {
        /// Lines found.
        lines: u64,
        /// Materials.
        materials: u32,
    },
}

impl fmt::Display for SectionFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Repeated => write!(f, "occurs twice"),
            Self::Stride(s) => write!(f, "has {s} bytes per record, not this version's"),
            Self::Offset(o) => write!(f, "starts at byte {o}: inside the header or not a multiple of 64"),
            Self::Count(n) => write!(f, "has {n} records: not what the blob's length or its other sections allow"),
            Self::Overlaps(k) => write!(f, "shares bytes with section `{}`", k.name()),
        }
    }
}

impl fmt::Display for ChildFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::EmptyBox(x) => write!(f, "is unused, but its box has a bound {x}, not infinity"),
            Self::Bounds(x) => write!(f, "has an invalid bound {x}"),
            Self::Outside(x) => write!(f, "has a bound {x} outside its parent's box"),
            Self::Order { expected, found } => write!(f, "refers to {found}, depth-first order has {expected} here"),
            Self::Count(n) => write!(f, "is a leaf of {n} triangles, not 1 to 8"),
            Self::Deep => write!(f, "is a node below {MAX_TREE_DEPTH} levels"),
        }
    }
}

impl fmt::Display for SlotFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unused => write!(f, "is beyond the leaf's count, but not empty"),
            Self::Vertex(x) => write!(f, "has a coordinate {x} that is not its triangle's"),
            Self::Outside(x) => write!(f, "has a coordinate {x} outside the leaf's box"),
        }
    }
}

impl fmt::Display for ObjectFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Order => write!(f, "does not follow the object before it, or does not fit into the sections"),
            Self::Empty => write!(f, "holds nothing, or lacks a tree or what its tree is about"),
            Self::Lights(n) => write!(f, "states {n} lights, not those of its triangles and instances"),
            Self::Coverage { instances, met } => {
                write!(f, "has a top-level tree of {met} references, not each of {instances} instances once")
            }
        }
    }
}

impl fmt::Display for InstanceFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Entry(x) => write!(f, "its transform has an entry {x}"),
            Self::Singular(x) => write!(
                f,
                "its transform is singular, or may be between its keys (condition {x}, at most {MAX_CONDITION})"
            ),
            Self::Outside(x) => write!(f, "it reaches the coordinate {x}"),
            Self::Object(o) => write!(f, "object {o} does not exist, is the world, or nests too deep"),
            Self::Derived => write!(f, "its inverse, condition or flags are not those of its transform"),
            Self::Lights(n) => write!(f, "its lights, from {n} on, are not those of its object"),
        }
    }
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Instructions { missing } => {
                write!(f, "this build needs a processor with {INSTRUCTION_SET}; this one lacks {missing}")
            }
            Self::Truncated { needed, given } => write!(f, "scene blob needs {needed} bytes, {given} given"),
            Self::Magic => write!(f, "not a scene blob: the first bytes are not CROUPIER"),
            Self::Version(v) => write!(f, "scene blob of version {v}, this library reads version {VERSION}"),
            Self::Misaligned => write!(f, "scene blob must start at an address that is a multiple of 4"),
            Self::Hash { stated, found } => {
                write!(f, "scene blob is damaged: its header states hash {stated:016x}, its bytes have {found:016x}")
            }
            Self::SectionCount(n) => write!(f, "{n} sections, there are {} kinds", SectionKind::ALL.len()),
            Self::UnknownSection(k) => write!(f, "unknown section kind {k}"),
            Self::Section { kind, fault } => write!(f, "section `{}` {fault}", kind.name()),
            Self::Header => write!(f, "reserved bytes of the header are not 0"),
            Self::Reserved { of, index } => write!(f, "{}[{index}]: reserved bits are not 0", of.name()),
            Self::Kind { of, index, found } => write!(f, "{}[{index}]: kind {found} does not exist", of.name()),
            Self::Reference { of, index, to, found, count } => {
                write!(f, "{}[{index}]: wrong reference to {}[{found}], there are {count}", of.name(), to.name())
            }
            Self::Number { of, index, field, found } => {
                write!(f, "{}[{index}]: {} is {found}, out of range", of.name(), field.name())
            }
            Self::Child { node, slot, fault } => write!(f, "nodes[{node}]: child {slot} {fault}"),
            Self::Slot { leaf, slot, fault } => write!(f, "leaves[{leaf}]: triangle slot {slot} {fault}"),
            Self::Object { object, fault } => write!(f, "objects[{object}] {fault}"),
            Self::Instance { instance, fault } => write!(f, "instances[{instance}]: {fault}"),
            Self::Unreached { of, index } => write!(f, "{}[{index}]: not part of the tree, or childless", of.name()),
            Self::Coverage { triangles, slots } => {
                write!(f, "the leaves' {slots} slots do not hold each of {triangles} triangles exactly once")
            }
            Self::AliasTable { of, first, length, deviation } => {
                write!(f, "{}[{first}..+{length}]: probabilities disagree with thresholds by {deviation}", of.name())
            }
            Self::ShapeLights { light } => {
                write!(f, "lights[{light}]: lights with shapes come last, at most {MAX_SHAPE_LIGHTS} of them")
            }
            Self::Names { lines, materials } => {
                write!(
                    f,
                    "names must be UTF-8 with a line for each material at least: {lines} lines, {materials} materials"
                )
            }
        }
    }
}

impl core::error::Error for SceneError {}
