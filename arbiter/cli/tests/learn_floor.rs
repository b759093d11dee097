//! `yamabico learn floor` from outside: what it writes, and what it says of folders that cannot teach it.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use image::{GrayImage, Luma, Rgb, RgbImage};
use yamabico_vision::floor_color::FloorColors;
use yamabico_vision::floor_color_file::ColorFile;

struct Folder(PathBuf);

impl Folder {
    fn new(test: &str) -> Self {
        let path = std::env::temp_dir().join(format!("yamabico-floor-{}-{test}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    /// A green floor below a wall of this color, and its mask.
    fn mark(&self, name: &str, wall: [u8; 3]) {
        let floor = |u: u32, v: u32| [40 + (u % 20) as u8, 130 + (v % 20) as u8, 60];
        let picture = RgbImage::from_fn(60, 40, |u, v| Rgb(if v < 20 { wall } else { floor(u, v) }));
        picture.save(self.0.join(format!("{name}.png"))).unwrap();
        let mask = GrayImage::from_fn(60, 40, |u, v| {
            Luma([if u < 5 {
                128
            } else if v < 20 {
                0
            } else {
                255
            }])
        });
        mask.save(self.0.join(format!("{name}.mask.png"))).unwrap();
    }

    fn learn(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_yamabico"));
        command.args(["learn", "floor"]).arg(&self.0).arg("--out").arg(self.out());
        command.args(arguments).output().unwrap()
    }

    fn out(&self) -> PathBuf {
        self.0.join("out").join("floor.toml")
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn told(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

fn read(path: &Path) -> FloorColors {
    ColorFile::read(path).unwrap_or_else(|problem| panic!("{problem}"))
}

#[test]
fn pictures_and_masks_become_colors() {
    let folder = Folder::new("learns");
    folder.mark("one", [180, 170, 160]);
    folder.mark("two", [150, 40, 30]);
    for form in ["table", "thresholds"] {
        let output = folder.learn(&["--form", form]);
        assert_eq!(output.status.code(), Some(0), "{}", told(&output));
        assert!(told(&output).contains("one.png") && told(&output).contains("100.0 %"), "{}", told(&output));
        let colors = read(&folder.out());
        assert!(colors.contains([50, 140, 60]), "{form}");
        assert!(!colors.contains([180, 170, 160]) && !colors.contains([150, 40, 30]), "{form}");
    }
}

#[test]
fn what_cannot_teach_is_named() {
    let empty = Folder::new("empty");
    let output = empty.learn(&[]);
    assert_eq!(output.status.code(), Some(2));
    assert!(told(&output).contains("no picture"), "{}", told(&output));

    let alone = Folder::new("alone");
    alone.mark("one", [180, 170, 160]);
    std::fs::remove_file(alone.0.join("one.mask.png")).unwrap();
    assert!(told(&alone.learn(&[])).contains("one.mask.png is missing"));

    let lone = Folder::new("lone");
    lone.mark("one", [180, 170, 160]);
    lone.mark("two", [180, 170, 160]);
    std::fs::remove_file(lone.0.join("two.png")).unwrap();
    assert!(told(&lone.learn(&[])).contains("no picture to this mask"));

    let size = Folder::new("size");
    size.mark("one", [180, 170, 160]);
    GrayImage::new(60, 41).save(size.0.join("one.mask.png")).unwrap();
    let output = size.learn(&[]);
    assert!(told(&output).contains("60 x 41") && told(&output).contains("60 x 40"), "{}", told(&output));

    let black = Folder::new("black");
    black.mark("one", [180, 170, 160]);
    GrayImage::new(60, 40).save(black.0.join("one.mask.png")).unwrap();
    let output = black.learn(&[]);
    assert!(told(&output).contains("nothing is floor"), "{}", told(&output));
    assert!(!black.out().exists());
}
