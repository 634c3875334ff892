//! Chemical elements: symbols, radii, colours, weights.

use crate::scene::picture_file::linear_from_srgb;

/// One row of the table; element `z` is `ELEMENTS[z - 1]`.
#[derive(Debug)]
struct Row {
    symbol: &'static str,
    van_der_waals: Option<f64>,
    covalent: Option<f64>,
    /// 0xRRGGBB on the curve of sRGB.
    color: u32,
    weight: f64,
}

/// A chemical element, by its atomic number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Element(u8);

impl Element {
    /// Hydrogen.
    pub const HYDROGEN: Element = Element(1);

    /// The element of an atomic number from 1 to 118.
    pub fn of_number(number: u64) -> Option<Element> {
        (1..=ELEMENTS.len() as u64).contains(&number).then_some(Element(number as u8))
    }

    /// The element of a symbol, in upper or lower case; D and T are hydrogen.
    pub fn of_symbol(symbol: &str) -> Option<Element> {
        if symbol.eq_ignore_ascii_case("D") || symbol.eq_ignore_ascii_case("T") {
            return Some(Element::HYDROGEN);
        }
        let index = ELEMENTS.iter().position(|row| row.symbol.eq_ignore_ascii_case(symbol))?;
        Some(Element(index as u8 + 1))
    }

    /// The element that the label of an atom names: a symbol ("Ca"), one with an index, a charge or a mass
    /// about it ("C12", "Fe3+", "13C"), an atomic number ("20"), or a name of a force field whose first letter
    /// is a symbol ("OW", "CT1").
    pub fn of_label(label: &str) -> Option<Element> {
        if let Ok(number) = label.parse() {
            return Element::of_number(number);
        }
        let letters = label.trim_start_matches(|c: char| c.is_ascii_digit());
        let end = letters.find(|c: char| !c.is_ascii_alphabetic()).unwrap_or(letters.len());
        let letters = &letters[..end];
        Element::of_symbol(letters).or_else(|| Element::of_symbol(letters.get(..1)?))
    }

    /// The element whose standard atomic weight is nearest to a mass in unified atomic mass units, if it is near:
    /// within 0.005 u for hydrogen (a mass of 1 is one of reduced units) and its isotope of 2.014 u, 0.015 u up
    /// to 20 u (CH2 as one atom, 14.027 u, is no nitrogen), 0.1 u beyond.
    pub fn of_mass(mass: f64) -> Option<Element> {
        if (mass - 2.014).abs() < 0.005 {
            return Some(Element::HYDROGEN);
        }
        let off = |row: &Row| (row.weight - mass).abs();
        let (index, row) = ELEMENTS.iter().enumerate().min_by(|a, b| off(a.1).total_cmp(&off(b.1)))?;
        let near = match row.weight {
            weight if weight < 2.0 => 0.005,
            weight if weight < 20.0 => 0.015,
            _ => 0.1,
        };
        (off(row) <= near).then_some(Element(index as u8 + 1))
    }

    /// Its symbol, such as "Ca".
    pub fn symbol(self) -> &'static str {
        self.row().symbol
    }

    /// Van der Waals radius in angstrom; 2 where nobody has published one.
    ///
    /// Sources: for the main group Mantina, Chamberlin, Valero, Cramer and Truhlar, "Consistent van der Waals
    /// radii for the whole main group", Journal of Physical Chemistry A 113(19), 2009, table 12 (Bondi's values
    /// of 1964 where he has them, Rowland and Taylor's for hydrogen); for transition metals, lanthanides and
    /// actinides Alvarez, "A cartography of the van der Waals territories", Dalton Transactions 42, 2013, table 1.
    pub fn van_der_waals(self) -> f64 {
        self.row().van_der_waals.unwrap_or(2.0)
    }

    /// Covalent radius in angstrom (carbon sp3; manganese, iron and cobalt low spin); 1.6 where nobody has
    /// published one.
    ///
    /// Source: Cordero et al., "Covalent radii revisited", Dalton Transactions 21, 2008, table 2.
    pub fn covalent(self) -> f64 {
        self.row().covalent.unwrap_or(1.6)
    }

    /// The usual colour, linear Rec. 709.
    ///
    /// Source: the colours that Corey and Pauling gave to their models ("Molecular models of amino acids,
    /// peptides, and proteins", Review of Scientific Instruments 24(8), 1953; Koltun, US patent 3,170,246, 1965),
    /// in the shades and with the extension to all elements that Jmol's table "Jmol colors" publishes.
    pub fn color(self) -> [f32; 3] {
        from_hex(self.row().color)
    }

    fn row(self) -> &'static Row {
        &ELEMENTS[usize::from(self.0) - 1]
    }
}

/// 0xRRGGBB on the curve of sRGB as linear Rec. 709.
pub(super) fn from_hex(hex: u32) -> [f32; 3] {
    [16, 8, 0].map(|shift| linear_from_srgb(f64::from(hex >> shift & 0xff) / 255.0) as f32)
}

const fn row(symbol: &'static str, van_der_waals: f64, covalent: f64, color: u32, weight: f64) -> Row {
    const fn known(radius: f64) -> Option<f64> {
        if radius > 0.0 { Some(radius) } else { None }
    }
    Row { symbol, van_der_waals: known(van_der_waals), covalent: known(covalent), color, weight }
}

/// Radii in angstrom, 0 where there is none. Weights: IUPAC, "Standard atomic weights of the elements 2021",
/// Pure and Applied Chemistry 94(5), 2022, abridged to five digits; mass numbers of the longest-lived isotope
/// where no standard weight exists.
#[rustfmt::skip]
const ELEMENTS: [Row; 118] = [
    row("H", 1.10, 0.31, 0xffffff, 1.008),
    row("He", 1.40, 0.28, 0xd9ffff, 4.0026),
    row("Li", 1.81, 1.28, 0xcc80ff, 6.94),
    row("Be", 1.53, 0.96, 0xc2ff00, 9.0122),
    row("B", 1.92, 0.84, 0xffb5b5, 10.81),
    row("C", 1.70, 0.76, 0x909090, 12.011),
    row("N", 1.55, 0.71, 0x3050f8, 14.007),
    row("O", 1.52, 0.66, 0xff0d0d, 15.999),
    row("F", 1.47, 0.57, 0x90e050, 18.998),
    row("Ne", 1.54, 0.58, 0xb3e3f5, 20.180),
    row("Na", 2.27, 1.66, 0xab5cf2, 22.990),
    row("Mg", 1.73, 1.41, 0x8aff00, 24.305),
    row("Al", 1.84, 1.21, 0xbfa6a6, 26.982),
    row("Si", 2.10, 1.11, 0xf0c8a0, 28.085),
    row("P", 1.80, 1.07, 0xff8000, 30.974),
    row("S", 1.80, 1.05, 0xffff30, 32.06),
    row("Cl", 1.75, 1.02, 0x1ff01f, 35.45),
    row("Ar", 1.88, 1.06, 0x80d1e3, 39.95),
    row("K", 2.75, 2.03, 0x8f40d4, 39.098),
    row("Ca", 2.31, 1.76, 0x3dff00, 40.078),
    row("Sc", 2.58, 1.70, 0xe6e6e6, 44.956),
    row("Ti", 2.46, 1.60, 0xbfc2c7, 47.867),
    row("V", 2.42, 1.53, 0xa6a6ab, 50.942),
    row("Cr", 2.45, 1.39, 0x8a99c7, 51.996),
    row("Mn", 2.45, 1.39, 0x9c7ac7, 54.938),
    row("Fe", 2.44, 1.32, 0xe06633, 55.845),
    row("Co", 2.40, 1.26, 0xf090a0, 58.933),
    row("Ni", 2.40, 1.24, 0x50d050, 58.693),
    row("Cu", 2.38, 1.32, 0xc88033, 63.546),
    row("Zn", 2.39, 1.22, 0x7d80b0, 65.38),
    row("Ga", 1.87, 1.22, 0xc28f8f, 69.723),
    row("Ge", 2.11, 1.20, 0x668f8f, 72.630),
    row("As", 1.85, 1.19, 0xbd80e3, 74.922),
    row("Se", 1.90, 1.20, 0xffa100, 78.971),
    row("Br", 1.83, 1.20, 0xa62929, 79.904),
    row("Kr", 2.02, 1.16, 0x5cb8d1, 83.798),
    row("Rb", 3.03, 2.20, 0x702eb0, 85.468),
    row("Sr", 2.49, 1.95, 0x00ff00, 87.62),
    row("Y", 2.75, 1.90, 0x94ffff, 88.906),
    row("Zr", 2.52, 1.75, 0x94e0e0, 91.224),
    row("Nb", 2.56, 1.64, 0x73c2c9, 92.906),
    row("Mo", 2.45, 1.54, 0x54b5b5, 95.95),
    row("Tc", 2.44, 1.47, 0x3b9e9e, 97.0),
    row("Ru", 2.46, 1.46, 0x248f8f, 101.07),
    row("Rh", 2.44, 1.42, 0x0a7d8c, 102.91),
    row("Pd", 2.15, 1.39, 0x006985, 106.42),
    row("Ag", 2.53, 1.45, 0xc0c0c0, 107.87),
    row("Cd", 2.49, 1.44, 0xffd98f, 112.41),
    row("In", 1.93, 1.42, 0xa67573, 114.82),
    row("Sn", 2.17, 1.39, 0x668080, 118.71),
    row("Sb", 2.06, 1.39, 0x9e63b5, 121.76),
    row("Te", 2.06, 1.38, 0xd47a00, 127.60),
    row("I", 1.98, 1.39, 0x940094, 126.90),
    row("Xe", 2.16, 1.40, 0x429eb0, 131.29),
    row("Cs", 3.43, 2.44, 0x57178f, 132.91),
    row("Ba", 2.68, 2.15, 0x00c900, 137.33),
    row("La", 2.98, 2.07, 0x70d4ff, 138.91),
    row("Ce", 2.88, 2.04, 0xffffc7, 140.12),
    row("Pr", 2.92, 2.03, 0xd9ffc7, 140.91),
    row("Nd", 2.95, 2.01, 0xc7ffc7, 144.24),
    row("Pm", 0.0, 1.99, 0xa3ffc7, 145.0),
    row("Sm", 2.90, 1.98, 0x8fffc7, 150.36),
    row("Eu", 2.87, 1.98, 0x61ffc7, 151.96),
    row("Gd", 2.83, 1.96, 0x45ffc7, 157.25),
    row("Tb", 2.79, 1.94, 0x30ffc7, 158.93),
    row("Dy", 2.87, 1.92, 0x1fffc7, 162.50),
    row("Ho", 2.81, 1.92, 0x00ff9c, 164.93),
    row("Er", 2.83, 1.89, 0x00e675, 167.26),
    row("Tm", 2.79, 1.90, 0x00d452, 168.93),
    row("Yb", 2.80, 1.87, 0x00bf38, 173.05),
    row("Lu", 2.74, 1.87, 0x00ab24, 174.97),
    row("Hf", 2.63, 1.75, 0x4dc2ff, 178.49),
    row("Ta", 2.53, 1.70, 0x4da6ff, 180.95),
    row("W", 2.57, 1.62, 0x2194d6, 183.84),
    row("Re", 2.49, 1.51, 0x267dab, 186.21),
    row("Os", 2.48, 1.44, 0x266696, 190.23),
    row("Ir", 2.41, 1.41, 0x175487, 192.22),
    row("Pt", 2.29, 1.36, 0xd0d0e0, 195.08),
    row("Au", 2.32, 1.36, 0xffd123, 196.97),
    row("Hg", 2.45, 1.32, 0xb8b8d0, 200.59),
    row("Tl", 1.96, 1.45, 0xa6544d, 204.38),
    row("Pb", 2.02, 1.46, 0x575961, 207.2),
    row("Bi", 2.07, 1.48, 0x9e4fb5, 208.98),
    row("Po", 1.97, 1.40, 0xab5c00, 209.0),
    row("At", 2.02, 1.50, 0x754f45, 210.0),
    row("Rn", 2.20, 1.50, 0x428296, 222.0),
    row("Fr", 3.48, 2.60, 0x420066, 223.0),
    row("Ra", 2.83, 2.21, 0x007d00, 226.0),
    row("Ac", 2.80, 2.15, 0x70abfa, 227.0),
    row("Th", 2.93, 2.06, 0x00baff, 232.04),
    row("Pa", 2.88, 2.00, 0x00a1ff, 231.04),
    row("U", 2.71, 1.96, 0x008fff, 238.03),
    row("Np", 2.82, 1.90, 0x0080ff, 237.0),
    row("Pu", 2.81, 1.87, 0x006bff, 244.0),
    row("Am", 2.83, 1.80, 0x545cf2, 243.0),
    row("Cm", 3.05, 1.69, 0x785ce3, 247.0),
    row("Bk", 3.40, 0.0, 0x8a4fe3, 247.0),
    row("Cf", 3.05, 0.0, 0xa136d4, 251.0),
    row("Es", 2.70, 0.0, 0xb31fd4, 252.0),
    row("Fm", 0.0, 0.0, 0xb31fba, 257.0),
    row("Md", 0.0, 0.0, 0xb30da6, 258.0),
    row("No", 0.0, 0.0, 0xbd0d87, 259.0),
    row("Lr", 0.0, 0.0, 0xc70066, 262.0),
    row("Rf", 0.0, 0.0, 0xcc0059, 267.0),
    row("Db", 0.0, 0.0, 0xd1004f, 268.0),
    row("Sg", 0.0, 0.0, 0xd90045, 269.0),
    row("Bh", 0.0, 0.0, 0xe00038, 270.0),
    row("Hs", 0.0, 0.0, 0xe6002e, 269.0),
    row("Mt", 0.0, 0.0, 0xeb0026, 278.0),
    row("Ds", 0.0, 0.0, 0xeb0026, 281.0),
    row("Rg", 0.0, 0.0, 0xeb0026, 282.0),
    row("Cn", 0.0, 0.0, 0xeb0026, 285.0),
    row("Nh", 0.0, 0.0, 0xeb0026, 286.0),
    row("Fl", 0.0, 0.0, 0xeb0026, 289.0),
    row("Mc", 0.0, 0.0, 0xeb0026, 290.0),
    row("Lv", 0.0, 0.0, 0xeb0026, 293.0),
    row("Ts", 0.0, 0.0, 0xeb0026, 294.0),
    row("Og", 0.0, 0.0, 0xeb0026, 294.0),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_name_elements() {
        let symbol = |label| Element::of_label(label).map(Element::symbol);
        for (label, want) in [
            ("C", "C"),
            ("ca", "Ca"),
            ("C12", "C"),
            ("Fe3+", "Fe"),
            ("13C", "C"),
            ("20", "Ca"),
            ("OW", "O"),
            ("HW1", "H"),
            ("CT1", "C"),
            ("D", "H"),
            ("Cl-", "Cl"),
            ("Og", "Og"),
        ] {
            assert_eq!(symbol(label), Some(want), "{label}");
        }
        for label in ["", "X", "0", "119", "-1", "*", "é", "Q7"] {
            assert_eq!(symbol(label), None, "{label}");
        }
    }

    #[test]
    fn masses_name_elements_and_reduced_units_none() {
        let symbol = |mass| Element::of_mass(mass).map(Element::symbol);
        let named = [(1.00794, "H"), (2.014, "H"), (12.0, "C"), (12.0107, "C"), (14.0067, "N"), (15.9994, "O")];
        let heavy = [(22.98977, "Na"), (35.453, "Cl"), (39.948, "Ar"), (58.7, "Ni"), (58.93, "Co"), (65.409, "Zn")];
        named.into_iter().chain(heavy).for_each(|(mass, want)| assert_eq!(symbol(mass), Some(want), "{mass}"));
        for mass in [0.0, 1.0, 14.027, 15.035, 42.0, -3.0, f64::NAN, 1e9] {
            assert_eq!(symbol(mass), None, "{mass}");
        }
    }

    #[test]
    fn the_table_is_in_order_and_its_radii_are_sane() {
        for (index, row) in ELEMENTS.iter().enumerate() {
            let element = Element::of_number(index as u64 + 1).unwrap();
            assert_eq!(Element::of_symbol(row.symbol), Some(element));
            assert!((1.0..=3.5).contains(&element.van_der_waals()), "{}", row.symbol);
            assert!((0.28..=2.6).contains(&element.covalent()) && element.covalent() < element.van_der_waals());
        }
        let radii = |symbol| Element::of_symbol(symbol).map(|element| (element.van_der_waals(), element.covalent()));
        assert_eq!(radii("C"), Some((1.70, 0.76)));
        assert_eq!(radii("Au"), Some((2.32, 1.36)));
        assert_eq!(radii("Og"), Some((2.0, 1.6)));
        assert_eq!(Element::of_symbol("H").unwrap().color(), [1.0; 3]);
    }
}
