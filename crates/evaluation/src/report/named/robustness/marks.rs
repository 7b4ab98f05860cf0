//! How much the marks show, and how long they took.
use super::{Options, READING, against};
use crate::report::paper::Metric;
use crate::report::selection::Selection;
use crate::report::summary::Summary;
use crate::report::table::{Cell, Row, Table};
use crate::report::targets::{Column, PSNR_DB};

pub(super) fn table(selection: &Selection<'_>, options: &Options) -> Table {
    let mut rows = Vec::new();
    for column in Column::ALL {
        let marks = selection.marks_of(column.bits(), column.variant());
        let name = format!("{}, {} bits", column.variant(), column.bits());
        rows.push(Row::new(of_marks(name, &Summary::of_marks(&marks))));
        let mut scenes: Vec<&str> = marks.iter().map(|mark| mark.embedding.scene.as_str()).collect();
        scenes.dedup();
        for scene in scenes.into_iter().filter(|_| options.per_scene) {
            let of_scene: Vec<_> = marks
                .iter()
                .copied()
                .filter(|mark| mark.embedding.scene == scene)
                .collect();
            rows.push(Row {
                part: true,
                cells: of_marks(scene.into(), &Summary::of_marks(&of_scene)),
            });
        }
    }
    Table {
        title: "The marks".into(),
        columns: ["preset", "marks", "PSNR (dB)", "asked", "SSIM", "LPIPS", "seconds"]
            .map(String::from)
            .to_vec(),
        rows,
        notes: vec![READING.into()],
    }
}

fn of_marks(name: String, summary: &Summary) -> Vec<Cell> {
    let psnr = match (summary.psnr.differing, summary.psnr.identical) {
        (None, 1..) => Some(f64::INFINITY),
        (mean, _) => mean.map(|mean| mean.mean),
    };
    vec![
        Cell::text(name),
        Cell::Count(summary.runs as u64),
        Cell::psnr(summary.psnr),
        against(Metric::Psnr, None, Some(PSNR_DB), psnr),
        Cell::estimate(summary.ssim, 4),
        Cell::estimate(summary.lpips, 4),
        Cell::estimate(summary.seconds, 1),
    ]
}
