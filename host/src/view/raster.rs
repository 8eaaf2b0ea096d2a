//! A software rasteriser: triangles in, shaded pixels out, no graphics driver needed.

use image::{Rgb, RgbImage};
use nalgebra::{Isometry3, Point3, Vector3};

/// A colour, 0..=255 by channel.
pub type Color = [u8; 3];

/// A triangle to draw, seen from both sides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Triangle {
    /// Corners in the world frame, metres.
    pub corners: [Point3<f64>; 3],
    /// Its colour in full light.
    pub color: Color,
    /// Whether it is a mark that shines through everything solid, half transparent.
    pub mark: bool,
}

/// Where the picture is taken from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Position, world frame, metres.
    pub eye: Point3<f64>,
    /// The point in the middle of the picture.
    pub target: Point3<f64>,
    /// Vertical field of view, rad.
    pub field_of_view_rad: f64,
}

/// Samples along each side of a pixel: the edges' smoothing.
const SUPERSAMPLING: u32 = 3;

/// Nearest distance that is drawn, metres.
const NEAR_M: f64 = 0.01;

/// Solids or marks: each with a depth buffer of its own.
struct Layer {
    depth: Vec<f64>,
    color: Vec<Color>,
}

/// Draws triangles with a depth buffer, both sides lit by a lamp beside the camera and one from above.
///
/// `width` and `height` in pixels. Triangles that reach behind the camera are left out.
#[must_use]
pub fn render(
    triangles: &[Triangle],
    camera: &Camera,
    width: u32,
    height: u32,
    background: Color,
) -> RgbImage {
    let (w, h) = ((width * SUPERSAMPLING) as usize, (height * SUPERSAMPLING) as usize);
    let view = Isometry3::look_at_rh(&camera.eye, &camera.target, &Vector3::z());
    let focal_px = 0.5 * h as f64 / (0.5 * camera.field_of_view_rad).tan();
    let lamps = [
        ((camera.eye - camera.target).normalize() + Vector3::new(0.3, -0.2, 0.4)).normalize(),
        Vector3::new(-0.2, 0.3, 1.0).normalize(),
    ];

    let mut layers =
        [(); 2].map(|()| Layer { depth: vec![f64::INFINITY; w * h], color: vec![background; w * h] });
    for triangle in triangles {
        let Layer { depth, color } = &mut layers[usize::from(triangle.mark)];
        let seen = triangle.corners.map(|p| view * p);
        if seen.iter().any(|p| -p.z < NEAR_M) {
            continue;
        }
        let [a, b, c] = seen.map(|p| {
            let per_m = focal_px / -p.z;
            // 1/z is linear over the picture plane, z is not.
            (0.5 * w as f64 + p.x * per_m, 0.5 * h as f64 - p.y * per_m, 1.0 / -p.z)
        });
        let area = (b.0 - a.0) * (c.1 - a.1) - (c.0 - a.0) * (b.1 - a.1);
        if area.abs() < 1e-12 {
            continue;
        }
        let [p, q, r] = triangle.corners;
        let Some(normal) = (q - p).cross(&(r - p)).try_normalize(0.0) else { continue };
        let light = 0.32 + lamps.iter().zip([0.48, 0.25]).map(|(l, k)| k * l.dot(&normal).abs()).sum::<f64>();
        let shaded = triangle.color.map(|channel| (f64::from(channel) * light).min(255.0) as u8);

        let span = |values: [f64; 3], end: usize| {
            let low = values.into_iter().fold(f64::INFINITY, f64::min).floor().max(0.0);
            let high = values.into_iter().fold(f64::NEG_INFINITY, f64::max).ceil().min(end as f64);
            low as usize..high.max(0.0) as usize
        };
        for y in span([a.1, b.1, c.1], h) {
            for x in span([a.0, b.0, c.0], w) {
                let (px, py) = (x as f64 + 0.5, y as f64 + 0.5);
                let wa = ((b.0 - px) * (c.1 - py) - (c.0 - px) * (b.1 - py)) / area;
                let wb = ((c.0 - px) * (a.1 - py) - (a.0 - px) * (c.1 - py)) / area;
                let wc = 1.0 - wa - wb;
                if wa < 0.0 || wb < 0.0 || wc < 0.0 {
                    continue;
                }
                let z = 1.0 / (wa * a.2 + wb * b.2 + wc * c.2);
                let pixel = y * w + x;
                if z < depth[pixel] {
                    depth[pixel] = z;
                    color[pixel] = shaded;
                }
            }
        }
    }

    let [Layer { mut color, .. }, marks] = layers;
    for (solid, (mark, depth)) in color.iter_mut().zip(marks.color.iter().zip(&marks.depth)) {
        if depth.is_finite() {
            for (channel, over) in solid.iter_mut().zip(mark) {
                *channel = ((u16::from(*channel) + u16::from(*over)) / 2) as u8;
            }
        }
    }

    RgbImage::from_fn(width, height, |x, y| {
        let mut sum = [0u32; 3];
        for dy in 0..SUPERSAMPLING {
            for dx in 0..SUPERSAMPLING {
                let sample =
                    color[((y * SUPERSAMPLING + dy) as usize) * w + (x * SUPERSAMPLING + dx) as usize];
                for (total, channel) in sum.iter_mut().zip(sample) {
                    *total += u32::from(channel);
                }
            }
        }
        Rgb(sum.map(|total| (total / (SUPERSAMPLING * SUPERSAMPLING)) as u8))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearer_triangle_covers_the_farther_one() {
        let square = |z: f64, half: f64, color| {
            let p = |x: f64, y: f64| Point3::new(x * half, y * half, z);
            [
                Triangle { corners: [p(-1.0, -1.0), p(1.0, -1.0), p(1.0, 1.0)], color, mark: false },
                Triangle { corners: [p(-1.0, -1.0), p(1.0, 1.0), p(-1.0, 1.0)], color, mark: false },
            ]
        };
        let (red, blue) = ([250, 0, 0], [0, 0, 250]);
        let mut triangles = square(0.1, 0.05, red).to_vec();
        triangles.extend(square(0.0, 0.3, blue));
        // A camera straight above would look along the up direction: lean a little.
        let camera =
            Camera { eye: Point3::new(0.0, -0.05, 1.0), target: Point3::origin(), field_of_view_rad: 0.7 };
        let image = render(&triangles, &camera, 64, 64, [255, 255, 255]);
        let hue = |x, y| {
            let Rgb([r, g, b]) = *image.get_pixel(x, y);
            (r > 60 && g == 0 && b == 0, b > 60 && r == 0 && g == 0, r == 255 && g == 255 && b == 255)
        };
        assert!(hue(32, 32).0, "red in front");
        assert!(hue(20, 40).1, "blue around it");
        assert!(hue(0, 0).2, "background outside");

        triangles.iter_mut().skip(2).for_each(|triangle| triangle.mark = true);
        let through = render(&triangles, &camera, 64, 64, [255, 255, 255]);
        let Rgb([red, green, blue]) = *through.get_pixel(32, 32);
        assert!(red > 60 && green == 0 && blue > 60, "a mark shines through what is in front of it");
    }
}
