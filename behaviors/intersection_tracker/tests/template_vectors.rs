//! Known answers of template search: ssda.

use serde_json::Value;
use yamabico_core::image::ImageView;
use yamabico_intersection_tracker::template::correlation::{best_correlation, correlation, peak_offset};
use yamabico_intersection_tracker::template::ssda::{search, search_counted, threshold_search};
use yamabico_intersection_tracker::template::{PatchOrigin, SearchArea, Template, TemplateError};
use yamabico_testkit::vectors::perspective;

#[test]
fn ssda() {
    let file = perspective("ssda");
    let tolerance = file["tolerance"].as_f64().unwrap();
    let cases = file["cases"].as_array().unwrap();
    assert!(!cases.is_empty(), "no case");
    for case in cases {
        let (id, input, expect) = (case["id"].as_str().unwrap(), &case["input"], &case["expect"]);
        let (pixels, width, height) = picture(&input["search"]);
        let image = ImageView::new(&pixels, width, height, width).unwrap();
        let (patch, patch_width, patch_height) = picture(&input["template"]);
        let template = Template::of(ImageView::new(&patch, patch_width, patch_height, patch_width).unwrap());
        if expect["status"] == "flat_template" {
            assert_eq!(template.check(), Err(TemplateError::FlatTemplate), "{id}");
            assert!((template.deviation() - expect["std"].as_f64().unwrap()).abs() <= tolerance, "{id}");
            continue;
        }
        assert_eq!((template.check(), expect["status"].as_str()), (Ok(()), Some("ok")), "{id}");
        let area = SearchArea::whole(image, &template).unwrap();
        check_exact(id, expect, image, &template, &area);
        check_threshold_search(id, input, expect, image, &template, &area);
        check_correlation(id, expect, image, &template, &area, tolerance);
    }
}

fn check_exact(id: &str, expect: &Value, image: ImageView<'_>, template: &Template, area: &SearchArea) {
    let whole = |key: &str| expect[key].as_u64().unwrap();
    let counted = search_counted(image, template, area);
    assert_eq!((counted.best.position, u64::from(counted.best.sad)), (place(expect), whole("sad")), "{id}");
    assert_eq!(counted.evaluated, whole("evaluated_pixels_raster"), "{id}: pixels");
    let full = area.positions().count() * template.width() * template.height();
    assert_eq!(full as u64, whole("full_pixels"), "{id}: all pixels");
    for start in [area.first(), place(expect), area.last(), PatchOrigin { u: 7, v: 3 }] {
        assert_eq!(search(image, template, area, start), counted.best, "{id}: from {start:?}");
    }
}

fn check_threshold_search(
    id: &str,
    input: &Value,
    expect: &Value,
    image: ImageView<'_>,
    template: &Template,
    area: &SearchArea,
) {
    let threshold = input["classic_threshold"].as_u64().unwrap() as u32;
    let found = threshold_search(image, template, area, threshold);
    let expect = &expect["classic"];
    assert_eq!(found.position, place(expect), "{id}: threshold_search");
    assert_eq!(u64::from(found.count), expect["count"].as_u64().unwrap(), "{id}: threshold_search count");
    assert_eq!(
        u64::from(found.partial_error),
        expect["partial_error"].as_u64().unwrap(),
        "{id}: threshold_search"
    );
}

fn check_correlation(
    id: &str,
    expect: &Value,
    image: ImageView<'_>,
    template: &Template,
    area: &SearchArea,
    tolerance: f64,
) {
    let best = best_correlation(image, template, area);
    let wanted = &expect["zncc_best"];
    assert!((best.correlation - wanted["score"].as_f64().unwrap()).abs() <= tolerance, "{id}: {best:?}");
    let mut positions = wanted["positions_vu"].as_array().unwrap().iter();
    let is_best = |vu: &Value| {
        (vu[0].as_u64(), vu[1].as_u64()) == (Some(best.position.v as u64), Some(best.position.u as u64))
    };
    assert!(positions.any(is_best), "{id}: {best:?}");

    let at = place(expect);
    let subpixel = &expect["subpixel_at_sad_best"];
    let mut three = [None; 3];
    for (i, value) in three.iter_mut().enumerate() {
        let u = (at.u + i).checked_sub(1).filter(|&u| (area.first().u..=area.last().u).contains(&u));
        *value = u.map(|u| correlation(image, template, PatchOrigin { u, v: at.v }));
        match (*value, subpixel["zncc"][i].as_f64()) {
            (Some(ours), Some(wanted)) => assert!((ours - wanted).abs() <= tolerance, "{id}: zncc {i}"),
            (ours, wanted) => assert_eq!(ours, wanted, "{id}: zncc {i}"),
        }
    }
    let du = match three {
        [Some(before), Some(at), Some(after)] => peak_offset(before, at, after),
        _ => 0.0,
    };
    assert!((du - subpixel["du"].as_f64().unwrap()).abs() <= tolerance, "{id}: du {du}");
}

fn place(value: &Value) -> PatchOrigin {
    PatchOrigin { u: value["u"].as_u64().unwrap() as usize, v: value["v"].as_u64().unwrap() as usize }
}

fn picture(value: &Value) -> (Vec<u8>, usize, usize) {
    let rows: Vec<&Vec<Value>> =
        value.as_array().unwrap().iter().map(|row| row.as_array().unwrap()).collect();
    let pixels = rows.iter().flat_map(|row| row.iter().map(|level| level.as_u64().unwrap() as u8)).collect();
    (pixels, rows[0].len(), rows.len())
}
