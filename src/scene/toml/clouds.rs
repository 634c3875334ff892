//! `[[clouds]]`: what the table says, with the files that [`cloud_file`] reads.

use super::Reader;
use super::groups::Transform;
use super::shapes::after_group;
use super::table::{Item, Table};
use super::values::{NamedFile, file, flag, list, text};
use crate::scene::cloud_file;
use crate::scene::rules::{self, Broken, MOST_PRIMITIVES, Rule, polygon};
use crate::scene::{Cloud, CloudMaterial, CloudShapes, Polygon, Rows};
use glam::DVec3;

#[derive(Clone, Copy)]
enum Kind {
    Spheres,
    Disks,
    Boxes,
    Cylinders,
    Polygons,
    Particles,
}

const KINDS: &[(&str, Kind)] = &[
    ("spheres", Kind::Spheres),
    ("disks", Kind::Disks),
    ("boxes", Kind::Boxes),
    ("cylinders", Kind::Cylinders),
    ("polygons", Kind::Polygons),
    ("particles", Kind::Particles),
];

impl<'a> Reader<'a, '_> {
    /// Reads all clouds.
    pub fn read_clouds(&mut self) {
        let mut primitives = self.scene.objects.len();
        for (index, mut table) in self.tables("clouds", "cloud").into_iter().enumerate() {
            let (context, span) = (table.context, table.span.clone());
            let Some(kind) = table.kind(KINDS, &[]) else { continue };
            let clouds = match kind {
                Kind::Particles => self.particles(table, index).unwrap_or_default(),
                _ => self.cloud(table, kind).into_iter().collect(),
            };
            primitives = primitives.saturating_add(clouds.iter().map(Cloud::len).sum());
            if primitives > MOST_PRIMITIVES {
                context.fail(&span, "a scene must have at most 2^31 - 1 primitives", primitives.to_string());
                return;
            }
            self.scene.clouds.extend(clouds);
        }
        self.claim(None);
    }

    fn cloud(&self, table: Table<'a>, kind: Kind) -> Option<Cloud> {
        let shapes = table.need("file", |item| {
            let rows = named(item)?;
            match kind {
                Kind::Spheres => {
                    rows.read(|path| cloud_file::rows(path, cloud_file::SPHERES)).map(CloudShapes::Spheres)
                }
                Kind::Disks => rows.read(|path| cloud_file::rows(path, cloud_file::DISKS)).map(CloudShapes::Disks),
                Kind::Boxes => {
                    let rows = rows.read(|path| cloud_file::rows(path, cloud_file::BOXES))?;
                    Some(CloudShapes::Boxes(rows, None))
                }
                Kind::Cylinders => {
                    let rows = rows.read(|path| cloud_file::rows(path, cloud_file::CYLINDERS))?;
                    Some(CloudShapes::Cylinders(rows, table.or("caps", true, flag)?))
                }
                Kind::Particles => None, // read elsewhere
                Kind::Polygons => {
                    let corners = rows.read(|path| cloud_file::rows(path, cloud_file::CORNERS))?;
                    let starts = table.need("sizes", |item| starts(&named(item)?, corners.len()))?;
                    Some(CloudShapes::Polygons { corners, starts })
                }
            }
        });
        // Known as a key even where the corners are broken.
        let _ = matches!(kind, Kind::Polygons) && table.has("sizes")
            || matches!(kind, Kind::Cylinders) && table.has("caps");
        let len = shapes.as_ref().map(CloudShapes::len);
        let material = self.cloud_material(&table, len);
        let colors = table.maybe("colors", |item| colors(&named(item)?, len));
        let name = table.maybe("name", text);
        let group = self.group(&table);
        let placed = shapes
            .zip(group)
            .and_then(|(shapes, (group, transform))| checked(&table, shapes, &transform).map(|shapes| (shapes, group)));
        table.finish();
        let (shapes, group) = placed?;
        Some(Cloud { shapes, material: material?, colors: colors?, name: name?, group })
    }

    /// One material for all rows, or a list and a file of indices into it.
    fn cloud_material(&self, table: &Table<'a>, len: Option<usize>) -> Option<CloudMaterial> {
        let material = table.item("material");
        let indices = table.item("materials");
        let Some(material) = material else { return table.missing("\"material\"") };
        match (material.value.is_array(), indices) {
            (false, None) => self.materials.find(&material).map(CloudMaterial::One),
            (false, Some(indices)) => {
                indices.wrong("needs a list of names as its material, such as material = [\"a\", \"b\"]")
            }
            (true, None) => table.missing("\"materials\", a file of indices into the list of its material"),
            (true, Some(item)) => {
                let list = list(&material, "names", |item| self.materials.find(item));
                let file = named(&item)?;
                let picked = file.read(|path| cloud_file::indices(path, "material"))?;
                file.same_length(picked.len(), len)?;
                let list = list?;
                let bad = picked.iter().position(|index| *index as usize >= list.len());
                if let Some(row) = bad {
                    let rule = format!("row {row}: index must be less than {}, the length of the list", list.len());
                    return file.broken(&rule, picked[row].to_string());
                }
                Some(CloudMaterial::Each(picked.iter().map(|index| list[*index as usize] as u32).collect()))
            }
        }
    }
}

/// The shapes without needless corners, where the group puts them, if they keep all rules there and before.
pub fn checked(table: &Table<'_>, shapes: CloudShapes, transform: &Transform) -> Option<CloudShapes> {
    let shapes = check(table, shapes)?;
    let moved = transform.cloud(shapes);
    if !transform.is_identity()
        && let Some((row, broken)) = look_at(&moved).first
    {
        let broken = after_group(broken);
        return table.broken(Broken { rule: format!("row {row} {}", broken.rule).into(), ..broken });
    }
    Some(moved)
}

/// A file with the place that names it.
pub struct Column<'i, 'a> {
    item: &'i Item<'a>,
    pub file: NamedFile,
}

pub fn named<'i, 'a>(item: &'i Item<'a>) -> Option<Column<'i, 'a>> {
    file(item).map(|file| Column { item, file })
}

impl Column<'_, '_> {
    fn read<T>(&self, read: impl FnOnce(&std::path::Path) -> Result<T, Broken>) -> Option<T> {
        read(&self.file.path).map_or_else(|broken| self.broken(&broken.rule, broken.found), Some)
    }

    /// Notes what is wrong with the file; always `None`.
    pub fn broken<T>(&self, rule: &str, found: String) -> Option<T> {
        self.item.context.fail(&self.item.span, format!("{} {rule}", self.file.shown), found);
        None
    }

    /// Checks that there is one value a row, where the number of rows is known.
    fn same_length(&self, values: usize, rows: Option<usize>) -> Option<()> {
        match rows {
            Some(rows) if rows != values => {
                self.broken(&format!("must have {rows} rows, one for each row of the cloud"), values.to_string())
            }
            _ => Some(()),
        }
    }
}

/// Where each polygon starts, from how many corners each has.
fn starts(file: &Column<'_, '_>, corners: usize) -> Option<Vec<u32>> {
    let sizes = file.read(|path| cloud_file::indices(path, "size"))?;
    let mut starts = vec![0u32];
    let mut sum = 0u64;
    for (row, size) in sizes.iter().enumerate() {
        if let Err(broken) = polygon::count(*size as usize) {
            return file.broken(&format!("row {row}: {}", broken.rule), broken.found);
        }
        sum += u64::from(*size);
        let Ok(start) = u32::try_from(sum) else {
            return file.broken("must name less than 2^32 corners", "more".to_owned());
        };
        starts.push(start);
    }
    if sum != corners as u64 {
        return file.broken(&format!("must sum up to the {corners} corners of the cloud"), sum.to_string());
    }
    Some(starts)
}

fn colors(file: &Column<'_, '_>, len: Option<usize>) -> Option<Vec<[f32; 3]>> {
    let rows = file.read(|path| cloud_file::rows(path, cloud_file::COLORS))?;
    file.same_length(rows.len(), len)?;
    for row in 0..rows.len() {
        for x in rows.row(row) {
            if let Some(text) = Rule::COLOR.broken_by(x) {
                return file.broken(&format!("row {row}: colour {text}"), rules::show(x));
            }
        }
    }
    Some(match rows {
        Rows::F32(rows) => rows,
        Rows::F64(rows) => rows.into_iter().map(|row| row.map(|x| x as f32)).collect(),
    })
}

/// The rows without needless corners, if they keep all rules.
fn check(table: &Table<'_>, shapes: CloudShapes) -> Option<CloudShapes> {
    let Findings { first, more, dropped } = look_at(&shapes);
    let item = table.item("file")?;
    if let Some((row, broken)) = first {
        let file = named(&item)?;
        let rule = format!("{} row {row}: {}", file.file.shown, broken.rule);
        let error = item.context.file.source.error(item.span.clone(), rule, broken.found);
        let help = match more {
            0 => "rows count from 0".to_owned(),
            _ => format!("rows count from 0; {more} more rows of this file break a rule"),
        };
        item.context.log.push(error.help(help));
        return None;
    }
    if let Some((row, _)) = dropped.first() {
        let rows = dropped.len();
        let text = format!(
            "corners repeated or in line with both neighbours are dropped; rows that have some: {rows}, the first is row {row}"
        );
        item.context.warn(&item.span, text);
    }
    Some(without(shapes, &dropped))
}

/// What a look at all rows of a cloud brings.
#[derive(Default)]
struct Findings {
    /// The first row that breaks a rule.
    first: Option<(usize, Broken)>,
    /// How many more rows do.
    more: usize,
    /// Polygons that have corners to drop, with these.
    dropped: Vec<(usize, Vec<usize>)>,
}

fn look_at(shapes: &CloudShapes) -> Findings {
    let mut findings = Findings::default();
    if matches!(shapes, CloudShapes::Spheres(rows) if rules::are_spheres(rows)) {
        return findings;
    }
    for row in 0..shapes.len() {
        let checked = match shapes {
            CloudShapes::Polygons { corners, starts } => {
                let range = starts[row] as usize..starts[row + 1] as usize;
                let corners = range.map(|corner| DVec3::from_array(corners.row(corner))).collect();
                polygon::clean(Polygon { corners, ..Polygon::default() }).map(|(_, useless)| useless)
            }
            _ => rules::shape(&shapes.shape(row)).map(|()| Vec::new()),
        };
        match checked {
            Ok(useless) if useless.is_empty() => {}
            Ok(useless) => findings.dropped.push((row, useless)),
            Err(broken) if findings.first.is_none() => findings.first = Some((row, broken)),
            Err(_) => findings.more += 1,
        }
    }
    findings
}

/// The polygons without the corners that are dropped.
fn without(shapes: CloudShapes, dropped: &[(usize, Vec<usize>)]) -> CloudShapes {
    let CloudShapes::Polygons { corners, mut starts } = shapes else { return shapes };
    if dropped.is_empty() {
        return CloudShapes::Polygons { corners, starts };
    }
    let mut keep = vec![true; corners.len()];
    let mut gone_by_row = vec![0; starts.len()];
    for (row, useless) in dropped {
        gone_by_row[row + 1] = useless.len() as u32;
        useless.iter().for_each(|corner| keep[starts[*row] as usize + corner] = false);
    }
    let mut gone = 0;
    for (start, more) in starts.iter_mut().zip(gone_by_row) {
        gone += more;
        *start -= gone;
    }
    let corners = match corners {
        Rows::F32(rows) => Rows::F32(kept(rows, &keep)),
        Rows::F64(rows) => Rows::F64(kept(rows, &keep)),
    };
    CloudShapes::Polygons { corners, starts }
}

fn kept<T>(rows: Vec<T>, keep: &[bool]) -> Vec<T> {
    rows.into_iter().zip(keep).filter(|(_, keep)| **keep).map(|(row, _)| row).collect()
}
