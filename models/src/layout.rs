use serde::de::IntoDeserializer;
use serde::{Deserialize, Serialize};

use crate::signature::{Role, Signature, f32s, i64s};
use crate::{ModelError, Port};

/// What a model's inputs and outputs mean (spec/models.md "Other people's models, by layout").
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Layout {
    /// Our network for organs, boundary distance and depth: see [`crate::Organ2d`].
    Organ2d,
    /// Our network for organs in point clouds: see [`crate::Organ3d`].
    Organ3d,
    /// Our network for depth: see [`crate::Relief2d`].
    Relief2d,
    /// Depth Anything, relative: inverse depth up to scale and shift.
    DepthAnything,
    /// Depth Anything, metric: metres. The same ports as the relative one, so it must be said.
    DepthAnythingMetric,
    /// METER: depth in centimetres, indoors.
    Meter,
    /// torchvision's Mask R-CNN.
    TorchvisionMaskRcnn,
    /// detectron2's Mask R-CNN.
    Detectron2MaskRcnn,
    /// YOLOv8-seg and YOLO11-seg as they are exported.
    YoloSeg,
    /// The same with non-maximum suppression in the graph.
    YoloSegNms,
    /// The image encoder of SAM and MobileSAM.
    SamEncoder,
    /// Their mask decoder.
    SamDecoder,
    /// The image encoder of SAM 2.
    Sam2Encoder,
    /// Its mask decoder.
    Sam2Decoder,
    /// U²-Net and u2netp: saliency.
    U2net,
}

/// As manifests spell it.
impl std::fmt::Display for Layout {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.serialize(f)
    }
}

impl std::str::FromStr for Layout {
    type Err = serde::de::value::Error;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Self::deserialize(text.into_deserializer())
    }
}

/// The layouts of others. -1 is a side that the graph may leave open; a role's first name is what adapters call it.
/// Where two rows fit a graph equally well the first is meant.
const TABLE: &[(Layout, Signature)] = &[
    (
        Layout::DepthAnything,
        Signature {
            inputs: &[f32s(&["pixel_values", "image"], &[1, 3, -1, -1])],
            outputs: &[f32s(&["predicted_depth", "depth"], &[1, -1, -1])],
        },
    ),
    (
        Layout::Meter,
        Signature { inputs: &[f32s(&["image"], &[1, 3, 192, 256])], outputs: &[f32s(&["depth"], &[1, 1, 48, 64])] },
    ),
    (
        Layout::TorchvisionMaskRcnn,
        Signature {
            inputs: &[f32s(&["image", "images", "input"], &[3, -1, -1])],
            outputs: &[
                f32s(&["boxes"], &[-1, 4]),
                i64s(&["labels"], &[-1]),
                f32s(&["scores"], &[-1]),
                f32s(&["masks"], &[-1, 1, -1, -1]),
            ],
        },
    ),
    (
        Layout::Detectron2MaskRcnn,
        Signature {
            inputs: &[f32s(&["image", "images", "data"], &[3, -1, -1])],
            outputs: &[
                f32s(&["pred_boxes"], &[-1, 4]),
                i64s(&["pred_classes"], &[-1]),
                f32s(&["pred_masks"], &[-1, 1, 28, 28]),
                f32s(&["scores"], &[-1]),
                i64s(&["image_size"], &[2]),
            ],
        },
    ),
    (
        Layout::YoloSeg,
        Signature {
            inputs: &[f32s(&["images"], &[1, 3, -1, -1])],
            outputs: &[f32s(&["output0"], &[1, -1, -1]), f32s(&["output1"], &[1, 32, -1, -1])],
        },
    ),
    (
        Layout::YoloSegNms,
        Signature {
            inputs: &[f32s(&["images"], &[1, 3, -1, -1])],
            outputs: &[f32s(&["output0"], &[1, -1, 38]), f32s(&["output1"], &[1, 32, -1, -1])],
        },
    ),
    (Layout::SamEncoder, Signature { inputs: &[f32s(SAM_IMAGE, &[1, 3, 1024, 1024])], outputs: SAM_EMBEDDING }),
    (Layout::SamEncoder, Signature { inputs: &[f32s(SAM_IMAGE, &[-1, -1, 3])], outputs: SAM_EMBEDDING }),
    (
        Layout::SamDecoder,
        Signature {
            inputs: &[
                f32s(&["image_embeddings"], &[1, 256, 64, 64]),
                f32s(&["point_coords"], &[1, -1, 2]),
                f32s(&["point_labels"], &[1, -1]),
                f32s(&["mask_input"], &[1, 1, 256, 256]),
                f32s(&["has_mask_input"], &[1]),
                f32s(&["orig_im_size"], &[2]),
            ],
            outputs: &[f32s(&["masks"], &[-1, -1, -1, -1]), f32s(&["iou_predictions"], &[-1, -1])],
        },
    ),
    (
        Layout::Sam2Encoder,
        Signature {
            inputs: &[f32s(&["image"], &[1, 3, 1024, 1024])],
            outputs: &[
                f32s(&["high_res_feats_0"], &[1, 32, 256, 256]),
                f32s(&["high_res_feats_1"], &[1, 64, 128, 128]),
                f32s(&["image_embed"], &[1, 256, 64, 64]),
            ],
        },
    ),
    (
        Layout::Sam2Decoder,
        Signature {
            inputs: &[
                f32s(&["image_embed"], &[1, 256, 64, 64]),
                f32s(&["high_res_feats_0"], &[1, 32, 256, 256]),
                f32s(&["high_res_feats_1"], &[1, 64, 128, 128]),
                f32s(&["point_coords"], &[-1, -1, 2]),
                f32s(&["point_labels"], &[-1, -1]),
                f32s(&["mask_input"], &[-1, 1, 256, 256]),
                f32s(&["has_mask_input"], &[-1]),
            ],
            outputs: &[f32s(&["masks"], &[-1, -1, -1, -1]), f32s(&["iou_predictions"], &[-1, -1])],
        },
    ),
    (
        Layout::U2net,
        Signature {
            inputs: &[f32s(&["input.1", "input"], &[1, 3, 320, 320])],
            // PyTorch numbers the outputs; the first is the fused one and the others are its side outputs.
            outputs: &[f32s(&["mask", "1959", "output"], &[1, 1, 320, 320])],
        },
    ),
];

/// What people and exporters call SAM's picture.
const SAM_IMAGE: &[&str] = &["input_image", "images", "image", "x"];
const SAM_EMBEDDING: &[Role] = &[f32s(&["image_embeddings"], &[1, 256, 64, 64])];

impl Layout {
    /// The layout that a graph's ports are of, by names and shapes; of several the one that leaves least open.
    #[must_use]
    pub fn recognise(inputs: &[Port], outputs: &[Port]) -> Option<Self> {
        let known =
            TABLE.iter().filter_map(|(layout, signature)| Some((signature.closeness(inputs, outputs)?, layout)));
        // `max_by_key` gives the last of equals.
        known.rev().max_by_key(|&(closeness, _)| closeness).map(|(_, &layout)| layout)
    }

    /// What adapters call each port of a graph of this layout: the layout's name for it, and the graph's. A port under
    /// another name is found by its place among those of its shape. Ours go by their own names.
    pub(crate) fn roles(self, inputs: &[Port], outputs: &[Port]) -> Result<Vec<(&'static str, String)>, ModelError> {
        let like = if self == Self::DepthAnythingMetric { Self::DepthAnything } else { self };
        let mut rows = TABLE.iter().filter(|(layout, _)| *layout == like).map(|(_, signature)| signature);
        let Some(first) = rows.clone().next() else { return Ok(Vec::new()) };
        rows.find_map(|signature| signature.roles(inputs, outputs)).ok_or_else(|| ModelError::Layout {
            layout: self,
            expected: first.to_string(),
            found: crate::signature::lines(inputs, outputs),
        })
    }
}
