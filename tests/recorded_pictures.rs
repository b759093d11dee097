//! Pictures in a rosbag2 drive a behavior like the same pictures in a folder: every proposal is equal to the byte.
//!
//! The bag is written by the Python package `rosbags`, in the Python of `YAMABICO_ROSBAGS_PYTHON` or in `python3`.

use std::path::Path;
use std::process::Command;

use yamabico::plugins::plugins;
use yamabico_core::message::{Message, MessageType, Proposal};
use yamabico_core::time::Time;
use yamabico_host::config::{Overrides, load};
use yamabico_runtime::record::Tap;

use crate::support::{run_seed, task};

#[derive(Default)]
struct Proposals(Vec<Vec<u8>>);

impl Tap for Proposals {
    fn message(&mut self, _: &str, message: &MessageType, _: Time, header: &[u8], _: &[u8]) {
        if message.name == Proposal::NAME {
            self.0.push(header.to_vec());
        }
    }
}

fn proposals_from_folder(images: &Path) -> Vec<Vec<u8>> {
    let task =
        task("corridor-photos", &[&format!("robot.sensors.front.files={:?}", images.to_str().unwrap())]);
    let mut proposals = Proposals::default();
    run_seed(&task, 1, &mut proposals);
    proposals.0
}

fn proposals_from_bag(bag: &Path, folder: &Path) -> Vec<Vec<u8>> {
    let robot = folder.join("robot.toml");
    let text = format!(
        "name = 'photo-camera'\n[footprint]\nradius_m = 0.2\n\
         [devices.photos]\ndriver = 'recording'\nfile = {bag:?}\n\
         [sensors.front]\ndevice = 'photos'\nkind = 'camera'\ntopic = '/camera/image/compressed'\nrate_hz = 1\n\
         calibration = 'guessed'\nintrinsics = {{ width = 960, height = 540, fov_deg = 90 }}\nmount = {{ z_m = 0.3 }}\n\
         [drive]\ndevice = 'photos'\nkind = 'none'\n"
    );
    std::fs::write(&robot, text).unwrap();
    let overrides = Overrides { robot: Some(robot), set: Vec::new() };
    let path = yamabico_testkit::config("corridor-photos.toml");
    let task = load(&path, &overrides, &plugins()).unwrap_or_else(|problems| panic!("{problems}"));
    let mut proposals = Proposals::default();
    run_seed(&task, 1, &mut proposals);
    proposals.0
}

#[test]
fn pictures_in_a_rosbag_give_the_proposals_of_the_same_pictures_in_a_folder() {
    let Some(data) = yamabico_testkit::data::data_set("corridor_drive") else { return };
    let images = data.canonicalize().unwrap().join("images");
    let python = std::env::var("YAMABICO_ROSBAGS_PYTHON").unwrap_or("python3".to_owned());
    let script = yamabico_testkit::workspace().join("sensors/recording/tests/python/write_pictures.py");
    let folder = std::env::temp_dir().join(format!("yamabico-pictures-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let expected = proposals_from_folder(&images);
    for storage in ["SQLITE3", "MCAP"] {
        let bag = folder.join(storage);
        let output = Command::new(&python).arg(&script).arg(&images).arg(&bag).arg(storage).output();
        if !output.as_ref().is_ok_and(|output| output.status.success()) {
            println!("skipped: {python} cannot write a bag with rosbags and numpy");
            break;
        }
        let found = proposals_from_bag(&bag, &folder);
        let equal = found.iter().zip(&expected).take_while(|(found, expected)| found == expected).count();
        println!("{storage}: {equal} of {} proposals are equal", expected.len());
        assert!(equal >= 130 && equal + 2 >= expected.len(), "{equal} of {} are equal", expected.len());
    }
    std::fs::remove_dir_all(folder).unwrap();
}
