//! Halts in the report: the pictures of their moments with overlays.

use super::super::charts;
use super::super::figure::escaped;
use super::super::moments::{Moment, Picture};
use super::{Page, swatch};

/// Quality of the pictures in the report, 1 to 100.
const JPEG_QUALITY: u8 = 80;
/// Radius of the robot in the drawing from above, if it is not in the recording, m.
const RADIUS_M: f64 = 0.2;

impl Page<'_> {
    pub(super) fn halts(&mut self) {
        let moments = self.run.moments.list();
        if moments.is_empty() {
            return;
        }
        self.add(format_args!(
            "<h2>Halts <small>what the cameras and the behaviors saw at that moment</small></h2>\n"
        ));
        let halts = self.run.trace.halts();
        for (index, moment) in moments.iter().enumerate() {
            let halt = halts.get(index).map(|mark| &mark.halt);
            let by = halt.map_or("", |halt| halt.by.as_str());
            let duration_s = halt.map_or(0.0, |halt| halt.duration_s);
            let reason =
                if moment.reason.is_empty() { String::new() } else { format!(": {}", moment.reason) };
            self.add(format_args!(
                "<section class=\"halt\"><h3>{:.1} s: {} for {duration_s:.1} s{}</h3><div class=\"pictures\">",
                self.axis.seconds(moment.at),
                escaped(by),
                escaped(&reason)
            ));
            self.moment(moment);
            self.add(format_args!("</div></section>\n"));
        }
        let others = halts.len().saturating_sub(moments.len());
        if others > 0 {
            self.add(format_args!("<p>{others} more halts without pictures are in the log.</p>\n"));
        }
    }

    fn moment(&mut self, moment: &Moment) {
        for picture in &moment.pictures {
            let age_ms = moment.at.seconds_after(picture.stamp) * 1e3;
            let Some(jpeg) = jpeg(picture) else { continue };
            let layers = picture.layers.iter();
            let legend: String = layers
                .map(|(behavior, name, color)| swatch(*color, &format!("{behavior}: {name}")))
                .collect();
            self.add(format_args!(
                "<figure><img alt=\"{0} with overlays\" src=\"data:image/jpeg;base64,{1}\">\
                 <figcaption>{0}, {age_ms:.0} ms before the halt<br>{legend}</figcaption></figure>",
                escaped(&picture.topic),
                base64(&jpeg)
            ));
        }
        let radius_m = self.fact("radius_m").and_then(|radius| radius.parse().ok()).unwrap_or(RADIUS_M);
        if let Some(figure) = charts::from_above(&moment.from_above, radius_m) {
            let mut legend = String::new();
            for (behavior, marks) in &moment.from_above {
                for layer in yamabico_core::overlay::layers(marks) {
                    if layer.space == yamabico_core::overlay::Space::Robot && !layer.marks.is_empty() {
                        legend += &swatch(layer.color, &format!("{behavior}: {}", layer.name));
                    }
                }
            }
            self.add(format_args!(
                "<figure>{}<figcaption>from above<br>{legend}</figcaption></figure>",
                figure.svg()
            ));
        }
    }
}

fn jpeg(picture: &Picture) -> Option<Vec<u8>> {
    let mut data = Vec::new();
    let encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut data, JPEG_QUALITY);
    picture.image.write_with_encoder(encoder).ok()?;
    Some(data)
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for part in bytes.chunks(3) {
        let word =
            part.iter().chain([0, 0].iter()).take(3).fold(0_u32, |word, &byte| word << 8 | u32::from(byte));
        for digit in 0..4 {
            let value = word >> (18 - 6 * digit) & 63;
            text.push(if digit <= part.len() { char::from(DIGITS[value as usize]) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_the_rfc() {
        // RFC 4648, section 10.
        for (text, encoded) in
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")]
        {
            assert_eq!(base64(text.as_bytes()), encoded);
        }
    }
}
