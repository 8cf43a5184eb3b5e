//! Figures as PNG.

use super::failure::Failure;
use super::file;
use resvg::tiny_skia::Pixmap;
use resvg::usvg::fontdb::{Database, Style, Weight};
use resvg::usvg::{Options, Transform, Tree};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Pixels per unit of a figure: a page shows it with one, and screens have two for that.
const SCALE: f32 = 2.0;

/// Families that have the signs of a report, those first that look like the page.
const FAMILIES: [&str; 9] =
    ["Segoe UI", "Helvetica Neue", "Helvetica", "Arial", "Noto Sans", "DejaVu Sans", "Liberation Sans", "Cantarell", "Ubuntu"];

/// Writes figures (name and SVG) as PNG files into a folder; returns their paths.
pub fn write(folder: &Path, figures: &[(String, String)]) -> Result<Vec<PathBuf>, Failure> {
    let mut options = Options::default();
    options.fontdb_mut().load_system_fonts();
    name_family(options.fontdb_mut()).ok_or(Failure::Fonts)?;
    std::fs::create_dir_all(folder).map_err(|error| Failure::write(folder, error))?;
    let one = |(name, svg): &(String, String)| {
        let path = folder.join(name).with_extension("png");
        let bytes = drawn(svg, &options).map_err(|what| Failure::Picture { path: path.clone(), what })?;
        file::write(&path, |out| out.write_all(&bytes))?;
        Ok(path)
    };
    figures.iter().map(one).collect()
}

/// Names the family that figures ask for without a name: one of those known, else that of the first upright font. None where there are no fonts.
fn name_family(fonts: &mut Database) -> Option<()> {
    let of = |name: &str| fonts.faces().any(|face| face.families.iter().any(|(family, _)| family == name));
    let upright = fonts.faces().find(|face| face.style == Style::Normal && face.weight == Weight::NORMAL && !face.monospaced);
    let any = || Some(upright.or_else(|| fonts.faces().next())?.families.first()?.0.clone());
    let family = FAMILIES.into_iter().find(|name| of(name)).map(str::to_owned).or_else(any)?;
    fonts.set_sans_serif_family(family.clone());
    // where a name is unknown, this one is taken
    fonts.set_serif_family(family);
    Some(())
}

/// The bytes of a PNG file, or why there are none.
fn drawn(svg: &str, options: &Options) -> Result<Vec<u8>, String> {
    let tree = Tree::from_str(svg, options).map_err(|error| error.to_string())?;
    let [width, height] = [tree.size().width(), tree.size().height()].map(|length| (SCALE * length).ceil() as u32);
    let mut picture = Pixmap::new(width, height).ok_or_else(|| format!("{width} × {height} pixels"))?;
    resvg::render(&tree, Transform::from_scale(SCALE, SCALE), &mut picture.as_mut());
    picture.encode_png().map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// The pictures have twice the size of the figure, its colours, and texts where there is a font.
    #[test]
    fn a_figure_is_drawn() {
        let svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 60 25\"><style>text { font: 12px system-ui, \
                   sans-serif; }</style><rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/><rect x=\"30\" y=\"5\" width=\"20\" \
                   height=\"10\" fill=\"#1f6feb\"/><text x=\"2\" y=\"20\">0.5</text></svg>";
        let mut options = Options::default();
        options.fontdb_mut().load_system_fonts();
        let fonts = name_family(options.fontdb_mut()).is_some();
        let picture = Pixmap::decode_png(&drawn(svg, &options).unwrap()).unwrap();
        assert_eq!((picture.width(), picture.height()), (120, 50));
        let colour = |x, y| picture.pixel(x, y).map(|p| (p.red(), p.green(), p.blue())).unwrap();
        assert_eq!((colour(80, 20), colour(110, 40)), ((0x1f, 0x6f, 0xeb), (255, 255, 255)));
        let dark = (0..50).flat_map(|y| (0..50).map(move |x| (x, y))).filter(|&(x, y)| colour(x, y).0 < 128).count();
        assert_eq!(dark > 20, fonts, "{dark}");
        assert!(drawn("<svg", &options).is_err());
    }

    #[test]
    fn without_fonts_there_is_no_family() {
        assert!(name_family(&mut Database::new()).is_none());
        let error = Failure::Fonts.to_string();
        assert!(error.contains("no font") && error.contains("fix: ") && error.contains("--svg"), "{error}");
    }
}
