//! Known answers of closing and opening: sek_morphology.

use serde_json::Value;
use yamabico_testkit::vectors::omni;
use yamabico_vision::bit_image::BitImage;
use yamabico_vision::morphology::Morphology;

fn mask(lines: &Value) -> BitImage {
    let lines: Vec<&str> = lines.as_array().unwrap().iter().map(|line| line.as_str().unwrap()).collect();
    let mut mask = BitImage::new(lines[0].len(), lines.len());
    for (v, line) in lines.iter().enumerate() {
        line.bytes().enumerate().filter(|(_, pixel)| *pixel == b'#').for_each(|(u, _)| mask.set(u, v));
    }
    mask
}

#[test]
fn sek_morphology() {
    let file = omni("sek_morphology");
    let cases = file["cases"].as_array().unwrap();
    assert!(!cases.is_empty());
    // One workspace for all sizes.
    let mut morphology = Morphology::default();
    for case in cases {
        let mut image = mask(&case["input"]);
        let n = case["iters"].as_u64().unwrap() as u32;
        match case["op"].as_str().unwrap() {
            "close" => morphology.close(&mut image, n),
            "open" => morphology.open(&mut image, n),
            "dilate" => morphology.dilate(&mut image, n),
            "erode" => morphology.erode(&mut image, n),
            other => panic!("unknown operation {other}"),
        }
        assert_eq!(image, mask(&case["output"]), "{}", case["id"]);
    }
}
