//! The statements of an NFF file: what each one takes, and what is wrong where it takes something else.
//!
//! A mistake spoils its own statement alone. Words that are no numbers stand in for the number that was
//! meant, and the search goes on; where numbers run out or are left over, it goes on at the next keyword.

use std::borrow::Cow;
use std::ops::Range;

use glam::DVec3;

use super::surface::{Seen, Surfaces};
use super::tokens::{Token, Tokens};
use crate::scene::error::{Source, shorten};
use crate::scene::rules::{self, Broken, Rule};
use crate::scene::{Cone, Cylinder, Object, Polygon, SceneErrors, Shape, Sphere, Warning};

const KEYWORDS: [&str; 8] = ["v", "b", "l", "f", "s", "c", "p", "pp"];
const VIEW_WORDS: [&str; 6] = ["from", "at", "up", "angle", "hither", "resolution"];
const MOST_SIDE: u32 = 65_536;
const MOST_PIXELS: u64 = 1 << 30;

/// Everything that a file says, in its own terms.
#[derive(Debug)]
pub(super) struct Statements<'a> {
    source: &'a Source,
    tokens: Tokens<'a>,
    /// The keyword of the statement that is being read.
    keyword: Token<'a>,
    /// Whether an object without a surface was met: told once.
    bare: bool,
    pub errors: SceneErrors,
    pub warnings: Vec<Warning>,
    pub view: Option<View>,
    pub background: Option<DVec3>,
    /// Position and colour.
    pub lights: Vec<(DVec3, Option<DVec3>)>,
    pub surfaces: Surfaces,
    pub objects: Vec<Object>,
}

/// A `v` statement.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct View {
    pub from: DVec3,
    pub at: DVec3,
    pub up: DVec3,
    /// Degrees between the centres of the outermost pixels, 0 < angle < 180.
    pub angle: f64,
    /// Pixels across and down.
    pub resolution: [u32; 2],
}

/// A number and where it stands.
#[derive(Debug, Clone, Copy)]
struct Number<'a> {
    value: f64,
    token: Token<'a>,
}

/// The rest of the statement is of no use; what is wrong with it has been said.
struct Spoilt;

type Read<T> = Result<T, Spoilt>;

impl<'a> Statements<'a> {
    /// Reads the whole file. What is wrong with it is in `errors`; the rest is what could be read.
    pub fn read(source: &'a Source) -> Self {
        let mut file = Statements {
            source,
            tokens: Tokens::new(source.text()),
            keyword: Token { text: "", at: 0 },
            bare: false,
            errors: SceneErrors::default(),
            warnings: Vec::new(),
            view: None,
            background: None,
            lights: Vec::new(),
            surfaces: Surfaces::default(),
            objects: Vec::new(),
        };
        while let Some(token) = file.tokens.next() {
            if file.statement(token).is_err() {
                file.skip_to_keyword();
            }
        }
        file
    }

    fn statement(&mut self, token: Token<'a>) -> Read<()> {
        let before = std::mem::replace(&mut self.keyword, token);
        match token.text {
            "v" => self.view(),
            "b" => self.background(),
            "l" => self.light(),
            "f" => self.surface(),
            "s" => self.sphere(),
            "c" => self.cone(),
            "p" => self.polygon(false),
            "pp" => self.polygon(true),
            _ => self.no_keyword(before),
        }
    }

    fn no_keyword(&mut self, before: Token<'a>) -> Read<()> {
        let token = self.keyword;
        let rule = match before.text {
            "" => "an NFF file must start with a keyword: v b l f s c p pp".into(),
            _ if token.text.parse::<f64>().is_err() => "a statement must start with a keyword: v b l f s c p pp".into(),
            name => format!("`{name}` in line {} must end before this number", self.source.place(before.at).line),
        };
        // A second word of the kind is measured against the last keyword too.
        self.keyword = before;
        self.wrong(token, rule);
        Err(Spoilt)
    }

    fn view(&mut self) -> Read<()> {
        let start = self.errors.len();
        let [from, at, up] = [self.part("from")?, self.part("at")?, self.part("up")?];
        let ([angle], [_]) = (self.part("angle")?, self.part("hither")?);
        let resolution = self.part("resolution")?;
        let sides = resolution.map(|side: Number| self.side(side));
        if self.errors.len() > start {
            return Ok(());
        }
        if self.view.is_some() {
            self.wrong(self.keyword, "a file must have one view");
        }
        let [width, height] = sides;
        if u64::from(width) * u64::from(height) > MOST_PIXELS {
            self.wrong(resolution[0].token, "a picture must have at most 2^30 pixels");
        }
        let [from, at, up] = [from, at, up].map(vector);
        let view = View { from, at, up, angle: angle.value, resolution: sides };
        // The edges of a coarse picture are farther out than its centres: their angle must be one, too.
        let edges = super::edge_angle(angle.value, height);
        if [angle.value, edges].into_iter().any(|angle| Rule::VFOV.broken_by(angle).is_some()) {
            self.wrong(angle.token, "the view's angle must be between 0 and 180 degrees");
        } else if let Err(broken) = rules::camera(&super::camera(&view)) {
            self.broken(broken);
        }
        self.view = Some(view);
        Ok(())
    }

    /// One line of the view: its word and the numbers after it.
    fn part<const N: usize>(&mut self, word: &'static str) -> Read<[Number<'a>; N]> {
        const USAGE: &str = "from x y z, at x y z, up x y z, angle a, hither h, resolution w h";
        match self.tokens.peek() {
            Some(token) if token.text == word => self.tokens.next(),
            _ => return Err(self.missing(format!("a view must go on with `{word}` ({USAGE})"))),
        };
        self.numbers(USAGE)
    }

    /// A number of pixels; 1 where it is none.
    fn side(&mut self, side: Number<'a>) -> u32 {
        let pixels = side.value as u32;
        if f64::from(pixels) == side.value && (1..=MOST_SIDE).contains(&pixels) {
            return pixels;
        }
        self.wrong(side.token, "a resolution must be whole numbers of pixels, 1 to 65536");
        1
    }

    fn background(&mut self) -> Read<()> {
        let color = self.numbers("red green blue")?;
        self.check_color(color);
        if self.background.is_some() {
            self.wrong(self.keyword, "a file must have one background");
        }
        self.background = Some(vector(color));
        Ok(())
    }

    fn light(&mut self) -> Read<()> {
        const USAGE: &str = "x y z, then red green blue or nothing";
        let position = self.numbers(USAGE)?;
        let color = match self.tokens.peek() {
            Some(token) if !ends_statement(token) => Some(self.numbers(USAGE)?),
            _ => None,
        };
        if let Some(color) = color {
            self.check_color(color);
        }
        self.lights.push((vector(position), color.map(vector)));
        Ok(())
    }

    fn surface(&mut self) -> Read<()> {
        let numbers: [_; 8] = self.numbers("red green blue kd ks shine transmittance ior")?;
        self.check_color([numbers[0], numbers[1], numbers[2]]);
        let names = ["kd", "ks", "shine", "transmittance", "ior"];
        for (name, number) in names.into_iter().zip(&numbers[3..]) {
            if number.value < 0.0 {
                self.wrong(number.token, format!("{name} must be >= 0"));
            }
        }
        self.surfaces.set(numbers.map(|number| number.value));
        Ok(())
    }

    fn sphere(&mut self) -> Read<()> {
        let start = self.errors.len();
        let [x, y, z, radius] = self.numbers("x y z radius")?;
        if self.errors.len() > start {
            return Ok(());
        }
        if radius.value == 0.0 {
            self.wrong(radius.token, "sphere radius must not be 0");
            return Ok(());
        }
        let shape = Shape::Sphere(Sphere { center: vector([x, y, z]), radius: radius.value.abs() });
        self.solid(shape, seen(radius.value));
        Ok(())
    }

    fn cone(&mut self) -> Read<()> {
        let start = self.errors.len();
        let [x, y, z, radius, ax, ay, az, apex_radius] =
            self.numbers("x y z radius of the base, x y z radius of the apex")?;
        if self.errors.len() > start {
            return Ok(());
        }
        if radius.value == 0.0 && apex_radius.value == 0.0 {
            self.wrong(radius.token, "the radii of a cone must not both be 0");
            return Ok(());
        }
        let [least, most] = [radius.value.min(apex_radius.value), radius.value.max(apex_radius.value)];
        if least < 0.0 && most > 0.0 {
            self.wrong(apex_radius.token, "the radii of a cone must have one sign");
        }
        let (base, apex) = (vector([x, y, z]), vector([ax, ay, az]));
        let [radius, apex_radius] = [radius, apex_radius].map(|radius| radius.value.abs());
        let shape = if radius == apex_radius {
            Shape::Cylinder(Cylinder { base, apex, radius, caps: false })
        } else {
            Shape::Cone(Cone { base, apex, radius, apex_radius, caps: false })
        };
        self.solid(shape, seen(least));
        Ok(())
    }

    fn solid(&mut self, shape: Shape, seen: Seen) {
        match rules::shape(&shape) {
            Ok(()) => self.object(shape, seen),
            Err(broken) => self.broken(broken),
        }
    }

    fn polygon(&mut self, with_normals: bool) -> Read<()> {
        let start = self.errors.len();
        let count = self.count()?;
        let usage = if with_normals {
            "a count, then x y z nx ny nz for each corner"
        } else {
            "a count, then x y z for each corner"
        };
        // The count is only what the file claims: room is made for what is there.
        let mut polygon = Polygon::default();
        for _ in 0..count {
            polygon.corners.push(vector(self.numbers(usage)?));
            if with_normals {
                let normal = self.numbers(usage)?;
                polygon.normals.push(vector(normal));
                if self.errors.len() == start && vector(normal) == DVec3::ZERO {
                    self.wrong(normal[0].token, "a shading normal must not be zero");
                }
            }
        }
        if self.errors.len() == start {
            self.clean_polygon(polygon, if with_normals { Seen::BothSides } else { Seen::Usual });
        }
        Ok(())
    }

    /// How many corners follow.
    fn count(&mut self) -> Read<usize> {
        const RULE: &str = "a polygon must have a whole number of corners, 3 to 65535";
        let Some(token) = self.tokens.peek() else { return Err(self.missing(RULE)) };
        match token.text.parse::<usize>() {
            Ok(count) if rules::polygon::count(count).is_ok() => {
                self.tokens.next();
                Ok(count)
            }
            _ => Err(self.missing(RULE)),
        }
    }

    fn clean_polygon(&mut self, polygon: Polygon, seen: Seen) {
        match rules::polygon::clean(polygon) {
            Ok((polygon, dropped)) => {
                if !dropped.is_empty() {
                    let (place, text) = (self.source.place(self.keyword.at), rules::polygon::dropped_text(&dropped));
                    self.warnings.push(Warning { place, text });
                }
                self.object(Shape::Polygon(polygon), seen);
            }
            Err(broken) => self.broken(broken),
        }
    }

    /// A rule about the statement as a whole.
    fn broken(&mut self, broken: Broken) {
        self.errors.push(self.source.error(span(self.keyword), broken.rule, broken.found));
    }

    fn object(&mut self, shape: Shape, seen: Seen) {
        match self.surfaces.material(seen) {
            Some(material) => self.objects.push(Object { shape, material, name: None, group: None }),
            None if self.bare => {}
            None => {
                self.bare = true;
                self.wrong(self.keyword, "the first object must stand after its surface, an `f` statement");
            }
        }
    }

    fn check_color(&mut self, color: [Number<'a>; 3]) {
        for part in color {
            if part.value < 0.0 {
                self.wrong(part.token, "a colour must be >= 0");
            }
        }
    }

    /// The next `N` numbers. One that is none, not finite or too large is an error and reads as 1.
    fn numbers<const N: usize>(&mut self, usage: &'static str) -> Read<[Number<'a>; N]> {
        let nothing = Number { value: 1.0, token: self.keyword };
        let mut numbers = [nothing; N];
        for number in &mut numbers {
            let token = match self.tokens.peek() {
                Some(token) if !ends_statement(token) => token,
                _ => return Err(self.missing(format!("`{}` takes more numbers: {usage}", self.keyword.text))),
            };
            self.tokens.next();
            number.token = token;
            match decimal(token.text) {
                Some(value) if value.abs() <= rules::LARGEST => number.value = value,
                Some(_) => self.wrong(token, "a number must be finite and at most 1e15 in size"),
                None => self.wrong(token, format!("`{}` takes numbers: {usage}", self.keyword.text)),
            }
        }
        Ok(numbers)
    }

    /// Says what should stand where the next word is, or the end of the file.
    fn missing(&mut self, rule: impl Into<Cow<'static, str>>) -> Spoilt {
        match self.tokens.peek() {
            Some(token) => self.wrong(token, rule),
            None => {
                let end = self.source.text().trim_end().len();
                self.errors.push(self.source.error(end..end, rule, "the end of the file"));
            }
        }
        Spoilt
    }

    fn wrong(&mut self, token: Token<'a>, rule: impl Into<Cow<'static, str>>) {
        let found = format!("`{}`", shorten(token.text));
        self.errors.push(self.source.error(span(token), rule, found));
    }

    fn skip_to_keyword(&mut self) {
        while self.tokens.peek().is_some_and(|token| !KEYWORDS.contains(&token.text)) {
            self.tokens.next();
        }
    }
}

/// Whether a word is one that no number can be mistaken for.
fn ends_statement(token: Token) -> bool {
    KEYWORDS.contains(&token.text) || VIEW_WORDS.contains(&token.text)
}

/// A C floating-point literal, decimal; words such as `nan` and `inf` come back as what they mean.
fn decimal(text: &str) -> Option<f64> {
    text.parse().ok()
}

fn vector(numbers: [Number; 3]) -> DVec3 {
    DVec3::from_array(numbers.map(|number| number.value))
}

fn seen(radius: f64) -> Seen {
    if radius < 0.0 { Seen::Inside } else { Seen::Usual }
}

fn span(token: Token) -> Range<usize> {
    token.at..token.at + token.text.len()
}
