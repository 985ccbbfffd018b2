//! Parts of the image that a request renders.

use syntable_model::error::{Error, Result};
use syntable_model::stage::{Bodies, RenderRequest, Tile, Window};
use syntable_prepare::EmissiveBody;

/// The tiles of a request.
pub struct Shown {
    pub tiles: Vec<ShownTile>,
    /// For every body, whether any tile contains it.
    lit: Vec<bool>,
}

/// A tile.
pub struct ShownTile {
    window: Window,
    at: [u32; 2],
    /// Bodies that camera rays meet.
    pub seen: SeenBodies,
    /// Whether the tile contains no other bodies.
    pub alone: bool,
}

/// Bodies that camera rays meet.
pub enum SeenBodies {
    /// All bodies of the tile.
    All,
    /// One body, by its number.
    One(usize),
    /// For every body, whether camera rays meet it.
    Many(Vec<bool>),
}

impl Shown {
    /// The tiles of a request, for a scene of `count` bodies.
    ///
    /// # Errors
    /// If no body has a requested id, or if one of several tiles does not show exactly one body; permanent.
    pub fn of(request: &RenderRequest, count: usize) -> Result<Self> {
        let mut lit = vec![request.tiles.is_empty(); count];
        let is_only = request.only_tile().is_some();
        let mut tiles = Vec::with_capacity(request.tiles.len());
        for &Tile { window, at, bodies } in &request.tiles {
            let chosen = bodies.chosen(count)?;
            let alone = matches!(bodies, Bodies::Only(_));
            lit.iter_mut().zip(&chosen).for_each(|(lit, chosen)| *lit |= *chosen || !alone);
            let mut numbers = (0..count).filter(|&number| chosen[number]);
            let seen = match (bodies, is_only, numbers.next(), numbers.next()) {
                (Bodies::All | Bodies::Foreground, ..) | (Bodies::Only(_), true, ..) => SeenBodies::All,
                (_, true, ..) => SeenBodies::Many(chosen),
                (_, false, Some(one), None) => SeenBodies::One(one),
                (.., one, _) => {
                    let count = if one.is_none() { "no body" } else { "several bodies" };
                    return Err(Error::new(format!("one of several tiles shows {count}, at {at:?}"))
                        .help("give each of several tiles one body"));
                }
            };
            tiles.push(ShownTile { window, at, seen, alone });
        }
        Ok(Self { tiles, lit })
    }

    /// Whether any tile contains a body: light falls on it, and it lights others.
    pub fn is_lit(&self, body: usize) -> bool {
        self.lit[body]
    }

    /// The smallest window around all tiles.
    pub fn around(&self) -> Window {
        let windows = || self.tiles.iter().map(|tile| tile.window);
        let (x, y) = (windows().map(|window| window.x).min(), windows().map(|window| window.y).min());
        let ends = (windows().map(|window| window.right()).max(), windows().map(|window| window.bottom()).max());
        match (x.zip(y), ends) {
            (Some((x, y)), (Some(right), Some(bottom))) => {
                Window { x, y, width: (right - x) as u32, height: (bottom - y) as u32 }
            }
            _ => Window { x: 0, y: 0, width: 1, height: 1 },
        }
    }
}

impl ShownTile {
    /// Column and row in the image minus column and row among the tiles.
    pub fn offset(&self) -> [i32; 2] {
        [self.window.x - self.at[0] as i32, self.window.y - self.at[1] as i32]
    }

    /// First of the emissive bodies in the tile, and their number.
    pub fn emitters(&self, all: &[EmissiveBody]) -> [u32; 2] {
        match (&self.seen, self.alone) {
            (SeenBodies::One(one), true) => {
                let is_own = |emitter: &EmissiveBody| emitter.instance as usize == *one;
                let first = all.iter().position(is_own).unwrap_or(0);
                [first as u32, all.iter().filter(|&emitter| is_own(emitter)).count() as u32]
            }
            _ => [0, all.len() as u32],
        }
    }
}
