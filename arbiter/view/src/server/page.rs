//! The files of the page, embedded in the program.

/// A file of the page.
pub(super) struct PageFile {
    /// Path on the server.
    pub path: &'static str,
    /// Media type.
    pub media_type: &'static str,
    /// Contents.
    pub contents: &'static str,
}

macro_rules! page_file {
    ($path:literal, $file:literal, $media_type:literal) => {
        PageFile {
            path: $path,
            media_type: $media_type,
            contents: include_str!(concat!("../../page/", $file)),
        }
    };
}

/// All files of the page.
pub(super) const PAGE: [PageFile; 8] = [
    page_file!("/", "index.html", "text/html; charset=utf-8"),
    page_file!("/page.css", "page.css", "text/css; charset=utf-8"),
    page_file!("/page.js", "page.js", "text/javascript; charset=utf-8"),
    page_file!("/map.js", "map.js", "text/javascript; charset=utf-8"),
    page_file!("/strips.js", "strips.js", "text/javascript; charset=utf-8"),
    page_file!("/panels.js", "panels.js", "text/javascript; charset=utf-8"),
    page_file!("/uplot.js", "uplot/uPlot.iife.min.js", "text/javascript; charset=utf-8"),
    page_file!("/uplot.css", "uplot/uPlot.min.css", "text/css; charset=utf-8"),
];
