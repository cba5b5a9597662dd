//! The JSON of a glTF file, as far as it says where things are: materials, textures, images, lamps
//! and everything of one program's own is skipped unread.

use std::collections::BTreeMap;

use serde::Deserialize;

use super::fault::DAMAGED;
use crate::{Error, Place, Result};

/// The keys that the JSON of a glTF file may have; the first of them tells it from other JSON.
pub(super) const KEYS: [&str; 19] = [
    "accessors",
    "animations",
    "asset",
    "bufferViews",
    "buffers",
    "cameras",
    "extensions",
    "extensionsRequired",
    "extensionsUsed",
    "extras",
    "images",
    "materials",
    "meshes",
    "nodes",
    "samplers",
    "scene",
    "scenes",
    "skins",
    "textures",
];

/// Extensions that change nothing about where things are, by how their names begin.
const HARMLESS: [&str; 18] = [
    "ADOBE_materials_",
    "AGI_articulations",
    "CESIUM_primitive_outline",
    "EXT_lights_",
    "EXT_texture_",
    "FB_",
    "KHR_audio",
    "KHR_lights_",
    "KHR_materials_",
    // Its component types are read wherever they stand.
    "KHR_mesh_quantization",
    "KHR_node_hoverability",
    "KHR_node_selectability",
    "KHR_node_visibility",
    "KHR_techniques_webgl",
    "KHR_texture_",
    "KHR_xmp",
    "MSFT_texture_dds",
    "VRM",
];

/// Extensions whose data are compressed.
const COMPRESSIONS: [&str; 3] =
    ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"];

/// The whole document; positions in its lists are what everything refers to.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Document {
    pub(super) asset: Option<Asset>,
    pub(super) accessors: Vec<Accessor>,
    pub(super) animations: Vec<Animation>,
    pub(super) buffers: Vec<Buffer>,
    pub(super) buffer_views: Vec<BufferView>,
    pub(super) extensions_required: Vec<String>,
    pub(super) extensions_used: Vec<String>,
    pub(super) meshes: Vec<Mesh>,
    pub(super) nodes: Vec<Node>,
    pub(super) scene: Option<usize>,
    pub(super) scenes: Vec<Scene>,
    pub(super) skins: Vec<Skin>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Asset {
    pub(super) version: String,
    pub(super) min_version: Option<String>,
    pub(super) generator: Option<String>,
    pub(super) copyright: Option<String>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Scene {
    #[serde(default)]
    pub(super) nodes: Vec<usize>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Node {
    pub(super) name: Option<String>,
    #[serde(default)]
    pub(super) children: Vec<usize>,
    pub(super) camera: Option<usize>,
    pub(super) mesh: Option<usize>,
    pub(super) skin: Option<usize>,
    /// Column by column.
    pub(super) matrix: Option<Box<[f64; 16]>>,
    pub(super) translation: Option<[f64; 3]>,
    /// x, y, z, w.
    pub(super) rotation: Option<[f64; 4]>,
    pub(super) scale: Option<[f64; 3]>,
    pub(super) weights: Option<Vec<f32>>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Mesh {
    #[serde(default)]
    pub(super) primitives: Vec<Primitive>,
    pub(super) weights: Option<Vec<f32>>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Primitive {
    #[serde(default)]
    pub(super) attributes: BTreeMap<String, usize>,
    pub(super) indices: Option<usize>,
    /// What OpenGL calls it: 4 triangles, 5 a strip, 6 a fan; below that points and lines.
    pub(super) mode: Option<u32>,
    #[serde(default)]
    pub(super) targets: Vec<Target>,
}

/// A morph target, of which normals and tangents are not read.
#[derive(Debug, Deserialize)]
pub(super) struct Target {
    #[serde(rename = "POSITION")]
    pub(super) position: Option<usize>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Skin {
    pub(super) inverse_bind_matrices: Option<usize>,
    #[serde(default)]
    pub(super) joints: Vec<usize>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Animation {
    pub(super) name: Option<String>,
    #[serde(default)]
    pub(super) channels: Vec<Channel>,
    #[serde(default)]
    pub(super) samplers: Vec<Sampler>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Channel {
    pub(super) sampler: usize,
    pub(super) target: ChannelTarget,
}

#[derive(Debug, Deserialize)]
pub(super) struct ChannelTarget {
    /// None where an extension says what is animated.
    pub(super) node: Option<usize>,
    pub(super) path: String,
}

#[derive(Debug, Deserialize)]
pub(super) struct Sampler {
    pub(super) input: usize,
    pub(super) output: usize,
    pub(super) interpolation: Option<String>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Accessor {
    pub(super) buffer_view: Option<usize>,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) component_type: u32,
    #[serde(default)]
    pub(super) normalized: bool,
    pub(super) count: u64,
    #[serde(rename = "type")]
    pub(super) kind: Kind,
    pub(super) sparse: Option<Box<Sparse>>,
}

/// What an element is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub(super) enum Kind {
    Scalar,
    Vec2,
    Vec3,
    Vec4,
    Mat2,
    Mat3,
    Mat4,
}

#[derive(Debug, Deserialize)]
pub(super) struct Sparse {
    pub(super) count: u64,
    pub(super) indices: SparseIndices,
    pub(super) values: SparseValues,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseIndices {
    pub(super) buffer_view: usize,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) component_type: u32,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseValues {
    pub(super) buffer_view: usize,
    #[serde(default)]
    pub(super) byte_offset: u64,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Buffer {
    pub(super) uri: Option<String>,
    pub(super) byte_length: u64,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferView {
    pub(super) buffer: usize,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) byte_length: u64,
    pub(super) byte_stride: Option<u64>,
}

impl Document {
    /// From JSON; `place` makes of a line and column where in the file they are.
    ///
    /// # Errors
    /// What is no JSON or no glTF 2.0, or needs an extension that is not known.
    pub(super) fn parse(json: &[u8], place: impl Fn(usize, usize) -> Place) -> Result<Self> {
        let json = json.strip_prefix("\u{feff}".as_bytes()).unwrap_or(json);
        let document: Self = serde_json::from_slice(json).map_err(|fault| {
            let text = fault.to_string();
            // The place is said once, before the text.
            let text = text.rsplit_once(" at line ").map_or(text.as_str(), |(what, _)| what);
            Error::new(format!("not the JSON of a glTF file: {text}"))
                .at(place(fault.line(), fault.column()))
                .help(DAMAGED)
                .because(fault)
        })?;
        document.check()?;
        Ok(document)
    }

    fn check(&self) -> Result<()> {
        let Some(asset) = &self.asset else {
            return Err(Error::new("the JSON has no `asset`, so it is not glTF")
                .at(Place::Part("asset".into()))
                .help("read are glTF 2.0 files (.gltf, .glb)"));
        };
        let needed = asset.min_version.as_ref().unwrap_or(&asset.version);
        if !needed.starts_with("2.") || (asset.min_version.is_some() && needed != "2.0") {
            return Err(Error::new(format!("the file needs glTF {needed:?}; version 2.0 is read"))
                .at(Place::Part("asset".into()))
                .help("export it again as glTF 2.0"));
        }
        for (index, name) in self.extensions_required.iter().enumerate() {
            let place = Place::Part(format!("extensionsRequired[{index}]"));
            if COMPRESSIONS.contains(&name.as_str()) {
                return Err(compressed(name).at(place));
            }
            if !HARMLESS.iter().any(|known| name.starts_with(known)) {
                return Err(Error::new(format!(
                    "the file requires the extension {name:?}, which is not known"
                ))
                .at(place)
                .help("export it again without this extension"));
            }
        }
        Ok(())
    }

    /// The compression that the file uses, if any.
    pub(super) fn compression(&self) -> Option<&str> {
        let used = self.extensions_used.iter().map(String::as_str);
        used.into_iter().find(|name| COMPRESSIONS.contains(name))
    }
}

/// What is said of compressed data.
pub(super) fn compressed(name: &str) -> Error {
    Error::new(format!("its data are compressed with {name}, which is not read"))
        .help("export it again without compression")
}

/// Whether a text is a JSON object that begins as glTF does: its first key is one of glTF's.
pub(super) fn begins_like_gltf(head: &[u8]) -> bool {
    let head = head.strip_prefix("\u{feff}".as_bytes()).unwrap_or(head);
    let Some(rest) = head.trim_ascii_start().strip_prefix(b"{") else { return false };
    let Some(rest) = rest.trim_ascii_start().strip_prefix(b"\"") else { return false };
    KEYS.iter().any(|key| {
        let after = rest.strip_prefix(key.as_bytes()).and_then(|rest| rest.strip_prefix(b"\""));
        after.is_some_and(|rest| rest.trim_ascii_start().first().is_none_or(|&byte| byte == b':'))
    })
}
