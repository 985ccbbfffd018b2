//! Placers in Python.

use crate::errors::exception;
use crate::stages::call::with_python;
use crate::stages::kind::Kind;
use crate::stages::scene::{Rows, corners, pose, supports};
use parking_lot::Mutex;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;
use syntable_model::context::Context;
use syntable_model::error::{Error, Result};
use syntable_model::names::ObjectPool;
use syntable_model::pools::ObjectPools;
use syntable_model::random::Stream;
use syntable_model::registry::{Slot, Stage};
use syntable_model::scene::{AssetRef, BodyDraft, Motion, Object, Role, SceneBuilder};
use syntable_model::stage::Placer;

/// A body as Python places it: number of its asset among the drawn ones, pose, role, and whether it is fixed.
type Placed = (usize, Rows, String, bool);

/// A function in Python that places bodies, with its options.
struct PythonPlacer {
    /// From the supports, the assets, the seed of random numbers and the options to bodies.
    call: Arc<Py<PyAny>>,
    options: Arc<Py<PyAny>>,
}

/// Registers a placer.
#[pyfunction]
pub fn add_placer(kind: Kind, call: Py<PyAny>) -> PyResult<()> {
    let call = Arc::new(call);
    kind.add(Slot::Place, move |options| Stage::Place(Box::new(PythonPlacer { call: Arc::clone(&call), options })))
}

/// A wish of the function for an asset.
enum Wish {
    /// Any asset of some pools.
    Any(Vec<String>, Sender<Result<Given>>),
    /// The asset of a pool and a name.
    Named(AssetRef, Sender<Result<Given>>),
    /// The end of all wishes.
    Done,
}

/// An asset that the function gets.
struct Given {
    number: usize,
    asset: AssetRef,
    object: Arc<Object>,
}

/// The assets of a scene, for the function that places them.
#[pyclass(frozen, module = "syntable._syntable")]
pub struct SceneAssets(Mutex<Sender<Wish>>);

/// An asset in Python: number, pool, name, category, least and greatest corner, mass.
type Described = (usize, String, String, String, [[f64; 3]; 2], f64);

impl SceneAssets {
    fn given(&self, py: Python<'_>, wish: impl FnOnce(Sender<Result<Given>>) -> Wish) -> PyResult<Described> {
        let (reply, answer) = channel();
        let wish = wish(reply);
        let answered = {
            let sent = self.0.lock().send(wish);
            py.detach(move || sent.ok().and_then(|()| answer.recv().ok()))
        };
        let over = || PyRuntimeError::new_err("the scene is placed: ask for assets before the function returns");
        let Given { number, asset, object } = answered.ok_or_else(over)?.map_err(|error| exception(py, &error))?;
        let bounds = corners(&object.mesh.bounds());
        Ok((number, asset.pool, asset.name, object.category.clone(), bounds, object.mass.kg))
    }
}

#[pymethods]
impl SceneAssets {
    /// Draws an asset of some pools.
    fn draw(&self, py: Python<'_>, pools: Vec<String>) -> PyResult<Described> {
        self.given(py, |reply| Wish::Any(pools, reply))
    }

    /// The asset of a pool and a name.
    fn load(&self, py: Python<'_>, pool: String, name: String) -> PyResult<Described> {
        self.given(py, |reply| Wish::Named(AssetRef { pool, name }, reply))
    }
}

impl Placer for PythonPlacer {
    fn place(&self, scene: &mut SceneBuilder, context: &Context) -> Result<()> {
        context.workers.check_stop();
        let (wishes, inbox) = channel();
        let done = wishes.clone();
        let (surfaces, seed) = (&scene.supports, context.stream.seed());
        // The assets are borrowed, so that Python cannot hold them: this thread fetches them for the one that runs Python.
        let (placed, given) = thread::scope(|threads| {
            let python = threads.spawn(move || {
                let placed = with_python(|py| {
                    let assets = SceneAssets(Mutex::new(wishes));
                    let arguments = (supports(py, surfaces)?, assets, seed, &*self.options);
                    self.call.call1(py, arguments)?.extract::<Vec<Placed>>(py)
                });
                // The receiver lives until this message.
                let _ = done.send(Wish::Done);
                placed
            });
            let given = serve(&inbox, context);
            let placed = python.join().unwrap_or_else(|_| Err(Error::new("a placer in Python panicked")));
            (placed, given)
        });
        for (number, rows, role, is_fixed) in placed? {
            let unknown = || Error::new(format!("no asset has the number {number}"));
            let (asset, object) = given.get(number).cloned().ok_or_else(unknown)?;
            let role = match role.as_str() {
                "object" => Role::Object,
                "distractor" => Role::Distractor,
                "support" => Role::Support,
                _ => Role::Fixture,
            };
            let motion = if is_fixed { Motion::Fixed } else { Motion::Dynamic };
            scene.add(BodyDraft::new(asset, object, pose(&rows), role, motion));
        }
        Ok(())
    }
}

/// Fetches assets until the wishes end. Returns them in order.
fn serve(inbox: &Receiver<Wish>, context: &Context) -> Vec<(AssetRef, Arc<Object>)> {
    let mut given: Vec<(AssetRef, Arc<Object>)> = Vec::new();
    let mut stream: Stream = context.stream.child("assets");
    let mut answer = |found: Result<(AssetRef, Arc<Object>)>, reply: &Sender<Result<Given>>| {
        let number = given.len();
        let found = found.map(|(asset, object)| {
            given.push((asset.clone(), Arc::clone(&object)));
            Given { number, asset, object }
        });
        // A call that was interrupted does not wait for its asset.
        let _ = reply.send(found);
    };
    while let Ok(wish) = inbox.recv() {
        match wish {
            Wish::Any(pools, reply) => {
                let pools: Vec<ObjectPool> = pools.into_iter().map(ObjectPool).collect();
                answer(context.assets.draw_object(&ObjectPools::from(pools), &mut stream), &reply);
            }
            Wish::Named(asset, reply) => {
                let pool = context.assets.pool_name(&asset.pool).to_owned();
                let asset = AssetRef { pool, ..asset };
                let loaded = context.assets.get(&asset).and_then(|loaded| Ok((asset, loaded.into_object()?)));
                answer(loaded, &reply);
            }
            Wish::Done => break,
        }
    }
    given
}
