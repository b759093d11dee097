//! `yamabico learn floor`: the colors that it writes, and the folders that it refuses.

use std::path::{Path, PathBuf};
use std::process::Output;

use image::{GrayImage, Luma, Rgb, RgbImage};
use yamabico_vision::floor_color::FloorColors;
use yamabico_vision::floor_color_file::ColorFile;

use crate::program::{TestFolder, assert_exit, yamabico};

/// A folder of marked images.
struct Images(TestFolder);

impl Images {
    fn new(test: &str) -> Self {
        Self(TestFolder::new(&format!("floor-{test}")))
    }

    /// Adds an image of a green floor below a wall of this color, and its mask.
    fn mark(&self, name: &str, wall: [u8; 3]) {
        let floor = |u: u32, v: u32| [40 + (u % 20) as u8, 130 + (v % 20) as u8, 60];
        let image = RgbImage::from_fn(60, 40, |u, v| Rgb(if v < 20 { wall } else { floor(u, v) }));
        image.save(self.file(&format!("{name}.png"))).unwrap();
        let mask = GrayImage::from_fn(60, 40, |u, v| {
            Luma([if u < 5 {
                128
            } else if v < 20 {
                0
            } else {
                255
            }])
        });
        mask.save(self.file(&format!("{name}.mask.png"))).unwrap();
    }

    fn learn(&self, arguments: &[&str]) -> Output {
        let mut command = yamabico();
        command.args(["learn", "floor"]).arg(self.0.path()).arg("--out").arg(self.out());
        command.args(arguments).output().unwrap()
    }

    fn file(&self, name: &str) -> PathBuf {
        self.0.file(name)
    }

    fn out(&self) -> PathBuf {
        self.file("out/floor.toml")
    }
}

fn read(path: &Path) -> FloorColors {
    ColorFile::read(path).unwrap_or_else(|problem| panic!("{problem}"))
}

#[test]
fn images_and_masks_become_colors() {
    let images = Images::new("learns");
    images.mark("one", [180, 170, 160]);
    images.mark("two", [150, 40, 30]);
    for form in ["table", "thresholds"] {
        assert_exit(&images.learn(&["--form", form]), 0, &["one.png", "100.0 %"]);
        let colors = read(&images.out());
        assert!(colors.contains([50, 140, 60]), "{form}");
        assert!(!colors.contains([180, 170, 160]) && !colors.contains([150, 40, 30]), "{form}");
    }
}

#[test]
fn unsuitable_folders_are_refused() {
    let empty = Images::new("empty");
    assert_exit(&empty.learn(&[]), 2, &["has no images"]);

    let no_mask = Images::new("no-mask");
    no_mask.mark("one", [180, 170, 160]);
    std::fs::remove_file(no_mask.file("one.mask.png")).unwrap();
    assert_exit(&no_mask.learn(&[]), 2, &["one.mask.png is missing"]);

    let no_image = Images::new("no-image");
    no_image.mark("one", [180, 170, 160]);
    no_image.mark("two", [180, 170, 160]);
    std::fs::remove_file(no_image.file("two.png")).unwrap();
    assert_exit(&no_image.learn(&[]), 2, &["two.mask.png", "the image of this mask is missing"]);

    let size = Images::new("size");
    size.mark("one", [180, 170, 160]);
    GrayImage::new(60, 41).save(size.file("one.mask.png")).unwrap();
    assert_exit(&size.learn(&[]), 2, &["60 x 41", "60 x 40"]);

    let black = Images::new("black");
    black.mark("one", [180, 170, 160]);
    GrayImage::new(60, 40).save(black.file("one.mask.png")).unwrap();
    assert_exit(&black.learn(&[]), 2, &["no pixel is floor"]);
    assert!(!black.out().exists());
}
