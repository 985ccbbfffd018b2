//! Puts items down by the layout of a step.

use super::item::Items;
use super::layout::{Grid, Layout, Rows};
use super::options::Arrange;
use super::site::Sites;
use syntable_model::prelude::*;

/// Maximum number of assets that are drawn for a row until one fits beside the last row.
const MAX_DRAWS: u32 = 8;

/// Puts down all items of a scene.
pub fn fill(options: &Arrange, sites: &mut Sites, items: &mut Items, stream: &Stream) -> Result<()> {
    match &options.layout {
        Layout::Scatter => scatter(options, sites, items),
        Layout::Rows(rows) => rows.fill(options, sites, items, stream),
        Layout::Grid(grid) => grid.fill(options, sites, items, stream),
    }
}

fn scatter(options: &Arrange, sites: &mut Sites, items: &mut Items) -> Result<()> {
    while !items.is_done() {
        let first = items.draw()?;
        let place = first.stream.child("place");
        let site = sites.draw(&mut place.child("support"));
        let (area, height) = (sites.all()[site].area, sites.all()[site].height);
        let item = items.item(&first, area.yaw(), height, &place)?;
        let gap = options.gap_m.draw(&mut place.child("gap"));
        let mut tries = place.child("position");
        let origin = item.footprint.moved([area.center().x, area.center().y, 0.0]);
        let extent = origin.extent(&area);
        for _ in 0..options.max_tries {
            let range = |edge: usize| (area.edges()[edge] - (extent[edge][1] - extent[edge][0])).max(0.0) / 2.0;
            let middle = |edge: usize| (extent[edge][1] + extent[edge][0]) / 2.0;
            let along = [0, 1].map(|edge| tries.uniform(-range(edge), range(edge)) - middle(edge));
            if sites.put(items, &item, site, along, gap)? {
                break;
            }
        }
    }
    Ok(())
}

impl Rows {
    fn fill(&self, options: &Arrange, sites: &mut Sites, items: &mut Items, stream: &Stream) -> Result<()> {
        for site in 0..sites.all().len() {
            let (area, height) = (sites.all()[site].area, sites.all()[site].height);
            items.share(sites.all().len() - site);
            let [width, depth] = area.edges();
            let rows = stream.child("rows").at(site as u64);
            let (mut left, mut draws) = (-width / 2.0, 0);
            for row in 0_u64.. {
                if items.is_done() || draws == MAX_DRAWS {
                    break;
                }
                let row = rows.at(row);
                let per_row = self.per_row.as_ref().map_or(i64::MAX, |per_row| per_row.draw(&mut row.child("count")));
                let before_row = items.mark();
                let first = items.draw()?;
                let (mut front, mut right, mut is_empty) = (-depth / 2.0, left, true);
                for number in 0..per_row {
                    if number > 0 && items.is_done() {
                        break;
                    }
                    let before = items.mark();
                    let object = if number == 0 { first.clone() } else { items.draw_like(&first)? };
                    let place = row.at(number as u64);
                    let gap = options.gap_m.draw(&mut place.child("gap"));
                    let item = items.item(&object, area.yaw(), height, &place)?;
                    let origin = item.footprint.moved([area.center().x, area.center().y, 0.0]);
                    let [x, y] = origin.extent(&area);
                    let along = [left - x[0], front - y[0]];
                    if front + (y[1] - y[0]) > depth / 2.0 || left + (x[1] - x[0]) > width / 2.0 {
                        items.rewind(before);
                        break;
                    }
                    // A place that another body blocks stays empty.
                    if place.child("occupied").chance(self.occupied) {
                        is_empty &= !sites.put(items, &item, site, along, 0.0)?;
                    } else {
                        items.rewind(if number == 0 { before_row } else { before });
                    }
                    (front, right) = (front + (y[1] - y[0]) + gap, right.max(left + (x[1] - x[0])));
                }
                if right > left {
                    left = right + self.row_gap_m.as_ref().unwrap_or(&options.gap_m).draw(&mut row.child("gap"));
                    draws = 0;
                } else if is_empty {
                    // The object is too wide for the rest of the support. A smaller one may follow.
                    draws += 1;
                }
            }
        }
        Ok(())
    }
}

impl Grid {
    fn fill(&self, options: &Arrange, sites: &mut Sites, items: &mut Items, stream: &Stream) -> Result<()> {
        for site in 0..sites.all().len() {
            let (area, height) = (sites.all()[site].area, sites.all()[site].height);
            items.share(sites.all().len() - site);
            let cells = stream.child("cells").at(site as u64);
            let counts = [(&self.columns, "columns"), (&self.rows, "rows")];
            let [columns, rows] = counts.map(|(count, name)| count.draw(&mut cells.child(name)));
            for cell in 0..columns * rows {
                if items.is_done() {
                    break;
                }
                let place = cells.at(cell as u64);
                if !place.child("occupied").chance(self.occupied) {
                    continue;
                }
                let first = items.draw()?;
                let item = items.item(&first, area.yaw(), height, &place)?;
                let mut jitter = place.child("jitter");
                let middle = |number: i64, count: i64, edge: usize| {
                    ((number as f64 + 0.5) / count as f64 - 0.5) * area.edges()[edge]
                };
                let along = [middle(cell % columns, columns, 0), middle(cell / columns, rows, 1)];
                let along = along.map(|x| x + jitter.uniform(-self.jitter_m, self.jitter_m));
                sites.put(items, &item, site, along, options.gap_m.draw(&mut place.child("gap")))?;
            }
        }
        Ok(())
    }
}
