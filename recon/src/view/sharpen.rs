//! A network's plant mask made as sharp as the picture: the network says where, the picture's own colours say which
//! pixels.

use demeter_frame::{Mask, Rgb};
use image::GrayImage;
use image::imageops::{FilterType, resize};

use super::patches;
use crate::statistics::quantile;

/// Levels of each colour channel that are told apart; finer ones would have too few pixels each.
const LEVELS: usize = 16;
/// The network is sure of plant and of background beyond these probabilities; such pixels teach the colours.
const SURE: [f32; 2] = [0.1, 0.9];
/// Fewest pixels of each that teach; with fewer the network's word stands.
const MIN_TAUGHT: f64 = 64.0;
/// Most that the network, and a colour, may say: logarithms of odds (guesses: colours part plants from plain
/// backgrounds better than a blurred mask does, and neither is always right).
const MOST_NETWORK: f32 = 5.0;
const MOST_COLOUR: f32 = 3.0;
/// Share of a connected patch that the network must have seen as plant: else it only has a plant's colour.
const MIN_SEEN: f64 = 0.3;
/// The green of a picture's plants is this quantile of that of the pixels that the network is sure of, frames being among
/// them; plants less green than the next are not told by it, and what is less than a share of it as green is grey (guesses).
const PLANT_GREEN: f64 = 0.9;
const LEAST_GREEN: f64 = 0.1;
const GREY: f64 = 0.1;
/// Grey patches of at most this share of the mask are glare and shade on leaves (a guess).
const SHADE: f64 = 0.003;
/// More grey than this share of the mask is a cabinet's frames, less may be brown leaves. On crops of plants up to 0.17 is
/// grey, in cabinets mostly more.
const FRAMES: f64 = 0.18;
/// A frame is a column or row that the mask fills to more than this share, this near to the border in shares of the
/// picture's width or height: windows and cabinets end straight there, plants do not (guesses).
const FRAME_FILL: f64 = 0.5;
const FRAME_DEPTH: f64 = 0.06;
/// Pixels beside a frame that its blur darkens.
const FRAME_BLUR: u32 = 2;

/// The pixels that show plants, 255 and 0, from the probability of plant, which may be smaller than the picture.
#[must_use]
pub fn sharpened(picture: &Rgb, plant: &Mask) -> GrayImage {
    let (width, height) = picture.dimensions();
    let plant = resize(plant, width, height, FilterType::Triangle);
    let odds = ColourOdds::of(picture, &plant);
    let mut mask = GrayImage::new(width, height);
    for ((to, colour), p) in mask.pixels_mut().zip(picture.pixels()).zip(plant.pixels()) {
        let p = p.0[0].clamp(1e-4, 1.0 - 1e-4);
        let said = (p / (1.0 - p)).ln().clamp(-MOST_NETWORK, MOST_NETWORK);
        to.0[0] = if said + odds.as_ref().map_or(0.0, |odds| odds.at(colour)) > 0.0 { 255 } else { 0 };
    }
    drop_grey(&mut mask, picture, &plant);
    drop_frame(&mut mask);
    drop_unseen(&mut mask, &plant);
    mask
}

/// Empties what is grey beside a green plant, where that is much: dark leaves and dark frames differ in hue alone.
fn drop_grey(mask: &mut GrayImage, picture: &Rgb, plant: &Mask) {
    let sure = picture.pixels().zip(plant.pixels()).filter(|(_, p)| p.0[0] > SURE[1]);
    let greens: Vec<f64> = sure.map(|(colour, _)| excess_green(colour)).collect();
    let Some(of_plants) = quantile(&greens, PLANT_GREEN).filter(|green| *green > LEAST_GREEN) else { return };
    let mut grey = mask.clone();
    for (inside, colour) in grey.pixels_mut().zip(picture.pixels()) {
        if excess_green(colour) >= GREY * of_plants {
            inside.0[0] = 0;
        }
    }
    let all = mask.iter().filter(|inside| **inside > 0).count() as f64;
    let mut frames = patches(&grey);
    frames.retain(|patch| patch.pixels.len() as f64 > SHADE * all);
    if frames.iter().map(|patch| patch.pixels.len()).sum::<usize>() as f64 > FRAMES * all {
        frames.iter().flat_map(|patch| &patch.pixels).for_each(|&p| mask.as_mut()[p] = 0);
    }
}

/// How much greener than grey a colour is, in shares of its brightness: excess green (Woebbecke et al. 1995) of
/// chromaticities, -1 to 2.
#[must_use]
pub fn excess_green(colour: &image::Rgb<u8>) -> f64 {
    let [r, g, b] = colour.0.map(f64::from);
    (2.0 * g - r - b) / (r + g + b).max(1.0)
}

/// Empties the straight dark edges of cabinets and windows: filled lines along the border with none further in.
fn drop_frame(mask: &mut GrayImage) {
    let (width, height) = mask.dimensions();
    let seen = mask.clone();
    let column = |x: u32| (0..height).filter(|&y| seen.get_pixel(x, y).0[0] > 0).count() as f64 / f64::from(height);
    let row = |y: u32| (0..width).filter(|&x| seen.get_pixel(x, y).0[0] > 0).count() as f64 / f64::from(width);
    for x in frame(width, column) {
        (0..height).for_each(|y| mask.put_pixel(x, y, image::Luma([0])));
    }
    for y in frame(height, row) {
        (0..width).for_each(|x| mask.put_pixel(x, y, image::Luma([0])));
    }
}

/// Which of `count` lines belong to a frame at either end, by the share of each that the mask fills.
fn frame(count: u32, filled: impl Fn(u32) -> f64) -> Vec<u32> {
    let depth = (FRAME_DEPTH * f64::from(count)) as u32;
    let is_full = |at: u32| filled(at) > FRAME_FILL;
    let mut lines = Vec::new();
    for at in 0..depth {
        for (line, inner) in [(at, depth), (count - 1 - at, count - 1 - depth)] {
            if is_full(line) && !is_full(inner) {
                lines.extend(line.saturating_sub(FRAME_BLUR)..(line + FRAME_BLUR + 1).min(count));
            }
        }
    }
    lines
}

/// How much likelier each colour is on plants than beside them.
struct ColourOdds(Vec<f32>);

impl ColourOdds {
    /// From the pixels that the network is sure of; `None` when they are too few.
    fn of(picture: &Rgb, plant: &Mask) -> Option<Self> {
        let mut counts = [vec![0.0f64; LEVELS.pow(3)], vec![0.0f64; LEVELS.pow(3)]];
        let mut total = [0.0; 2];
        for (colour, p) in picture.pixels().zip(plant.pixels()) {
            let class = match p.0[0] {
                p if p < SURE[0] => 0,
                p if p > SURE[1] => 1,
                _ => continue,
            };
            counts[class][bin(colour)] += 1.0;
            total[class] += 1.0;
        }
        if total.into_iter().any(|count| count < MIN_TAUGHT) {
            return None;
        }
        for counts in &mut counts {
            blur(counts);
        }
        // A colour that neither has shown says nothing.
        let unseen = 1.0;
        let share = |class: usize, k: usize| (counts[class][k] + unseen) / total[class];
        let even = (total[0] / total[1]).ln();
        let odds = |k: usize| {
            let odds = (share(1, k) / share(0, k)).ln();
            // With one count each the ratio of the totals is left over, which is no property of the colour.
            let shown = (counts[0][k] + counts[1][k]) / (counts[0][k] + counts[1][k] + 2.0 * unseen);
            ((odds - even * (1.0 - shown)) as f32).clamp(-MOST_COLOUR, MOST_COLOUR)
        };
        Some(Self((0..LEVELS.pow(3)).map(odds).collect()))
    }

    fn at(&self, colour: &image::Rgb<u8>) -> f32 {
        self.0[bin(colour)]
    }
}

fn bin(colour: &image::Rgb<u8>) -> usize {
    colour.0.iter().fold(0, |bin, &c| bin * LEVELS + usize::from(c) * LEVELS / 256)
}

/// (1, 2, 1)/4 along each channel: neighbouring colours are much alike.
fn blur(counts: &mut [f64]) {
    for stride in [1, LEVELS, LEVELS * LEVELS] {
        let raw = counts.to_vec();
        for (k, count) in counts.iter_mut().enumerate() {
            let level = k / stride % LEVELS;
            let below = if level > 0 { raw[k - stride] } else { raw[k] };
            let above = if level + 1 < LEVELS { raw[k + stride] } else { raw[k] };
            *count = (below + 2.0 * raw[k] + above) / 4.0;
        }
    }
}

/// Empties connected patches of which the network saw too little.
fn drop_unseen(mask: &mut GrayImage, plant: &Mask) {
    for patch in patches(mask) {
        let seen = patch.pixels.iter().filter(|&&p| plant.as_raw()[p] > 0.5).count();
        if (seen as f64) < MIN_SEEN * patch.pixels.len() as f64 {
            patch.pixels.iter().for_each(|&p| mask.as_mut()[p] = 0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Luma;

    /// A green disc before a white wall with a green picture on it, and the blurred word of a network that knows which
    /// of the two is a plant.
    fn scene() -> (Rgb, Mask, impl Fn(u32, u32) -> bool) {
        let is_plant = |x: u32, y: u32| (x as i32 - 40).pow(2) + (y as i32 - 60).pow(2) < 400;
        let is_picture = |x: u32, y: u32| (90..110).contains(&x) && (20..40).contains(&y);
        let noise = |x: u32, y: u32| ((x * 7 + y * 13) % 11) as u8;
        let picture = Rgb::from_fn(128, 128, |x, y| {
            let green = is_plant(x, y) || is_picture(x, y);
            image::Rgb(if green { [60 + noise(x, y), 120, 50] } else { [220, 225 - noise(x, y), 222] })
        });
        let plant = Mask::from_fn(32, 32, |x, y| {
            let away = f64::from((x as i32 * 4 - 38).pow(2) + (y as i32 * 4 - 58).pow(2)).sqrt();
            Luma([(1.0 / (1.0 + ((away - 20.0) / 3.0).exp())) as f32])
        });
        (picture, plant, is_plant)
    }

    #[test]
    fn edges_are_the_pictures_and_the_network_says_which_green_is_a_plant() {
        let (picture, plant, is_plant) = scene();
        let mask = sharpened(&picture, &plant);
        let wrong = mask.enumerate_pixels().filter(|(x, y, v)| (v.0[0] > 0) != is_plant(*x, *y)).count();
        assert!(wrong <= 4, "{wrong} of {} pixels", mask.len());
    }

    #[test]
    fn dark_edges_of_a_cabinet_are_no_plant_and_what_fills_the_picture_is() {
        let wall = |x: u32| x < 4 || (60..64).contains(&x);
        let mut mask = GrayImage::from_fn(128, 128, |x, _| Luma([if wall(x) { 255 } else { 0 }]));
        drop_frame(&mut mask);
        assert!(mask.enumerate_pixels().all(|(x, _, v)| (v.0[0] > 0) == (60..64).contains(&x)));
        let mut full = GrayImage::from_pixel(128, 128, Luma([255]));
        drop_frame(&mut full);
        assert!(full.pixels().all(|v| v.0[0] > 0));
    }

    #[test]
    fn dark_frames_go_and_dark_leaves_stay() {
        let is_frame = |x: u32| x < 10;
        let is_leaf = |x: u32| (60..80).contains(&x);
        let picture = Rgb::from_fn(128, 128, |x, _| {
            image::Rgb(if is_frame(x) {
                [31, 30, 29]
            } else if is_leaf(x) {
                [28, 36, 16]
            } else {
                [250, 248, 235]
            })
        });
        let seen = |x: u32| is_frame(x) || is_leaf(x);
        let plant = Mask::from_fn(128, 128, |x, _| Luma([if seen(x) { 0.95 } else { 0.01 }]));
        let mask = GrayImage::from_fn(128, 128, |x, _| Luma([if seen(x) { 255 } else { 0 }]));
        let mut found = mask.clone();
        drop_grey(&mut found, &picture, &plant);
        assert!(found.enumerate_pixels().all(|(x, _, p)| (p.0[0] > 0) == is_leaf(x)));
        // Without colour there is nothing to tell them by.
        let grey = Rgb::from_fn(128, 128, |x, y| image::Rgb([picture.get_pixel(x, y).0[1]; 3]));
        let mut kept = mask.clone();
        drop_grey(&mut kept, &grey, &plant);
        assert_eq!(kept, mask);
    }

    #[test]
    fn without_sure_pixels_the_networks_word_stands() {
        let (picture, _, _) = scene();
        for p in [0.2, 0.7] {
            let mask = sharpened(&picture, &Mask::from_pixel(9, 7, Luma([p])));
            assert!(mask.pixels().all(|v| (v.0[0] > 0) == (p > 0.5)), "{p}");
        }
        assert_eq!(sharpened(&Rgb::new(0, 0), &Mask::new(0, 0)).dimensions(), (0, 0));
    }
}
