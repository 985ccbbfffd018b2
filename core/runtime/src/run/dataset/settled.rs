//! The result of settling a scene, stored with the dataset. TOML keeps every bit of a number.

use crate::run::dataset::foreign::read_list;
use crate::run::dataset::layout;
use syntable_model::error::Result;
use syntable_model::scene::{SceneId, Settled};
use syntable_model::store::StoreFolder;

/// Writes the result of settling for a staged scene.
pub fn write(staged: &StoreFolder, scene: SceneId, settled: &Settled) -> Result<()> {
    let text = toml::to_string(settled).expect("poses and numbers are plain data");
    staged.write(&layout::settled(scene.0), text.as_bytes())
}

/// The result of settling a scene of a dataset; `None` if it is missing, unreadable, or larger than a run writes.
pub fn read(dataset: &StoreFolder, scene: SceneId) -> Option<Settled> {
    let text = read_list(dataset, &layout::settled(scene.0)).ok()??;
    toml::from_slice(&text).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::geometry::{Pose, UnitQuaternion, Vector3};
    use syntable_model::random::Stream;
    use syntable_model::scene::{
        AssetRef, BodyDraft, Moment, PlacedBodies, Removal, Role, SceneBuilder, SettleReport, Trajectory,
    };
    use syntable_testing::scenes::{body, box_mesh, object, table};

    #[test]
    fn a_scene_is_had_again_to_the_last_bit() {
        let place = || {
            let mut scene = table();
            for k in 0..40 {
                let cube = object("cube", box_mesh([0.1; 3]), [0.5; 3]);
                scene.add(body(cube, [0.1 * f64::from(k), 0.0, 0.05], Role::Object));
            }
            scene
        };
        let bits = |scene: &SceneBuilder| -> Vec<(u32, Vec<u64>)> {
            let numbers = |pose: &Pose| pose.to_homogeneous().iter().map(|x| x.to_bits()).collect();
            let with_mass = |body: &BodyDraft| {
                let mut all: Vec<u64> = numbers(&body.world_from_body);
                all.push(body.mass.kg.to_bits());
                (body.spawn, all)
            };
            let with_way = |body: &BodyDraft| {
                let (spawn, mut all) = with_mass(body);
                for (moment, pose) in body.trajectory.iter().flat_map(|trajectory| trajectory.poses()) {
                    all.push(moment.seconds().to_bits());
                    all.extend::<Vec<u64>>(numbers(pose));
                }
                (spawn, all)
            };
            scene.bodies().map(|(_, body)| with_way(body)).collect()
        };
        let mut stream = Stream::root(7);
        let mut uniform = || stream.uniform(-1.0, 1.0);
        let mut scene = place();
        let placed = PlacedBodies::of(&scene);
        let handles: Vec<_> = scene.bodies().map(|(handle, _)| handle).collect();
        for (k, &handle) in handles.iter().enumerate().skip(1) {
            match k % 5 {
                0 => drop(scene.remove(handle)),
                1 => scene.assign_mass(handle, 0.1 + 0.2 * f64::from(k as u32)),
                2 => {
                    let pose = |x| Pose::translation(x, 0.1, 1e-7);
                    let poses = [(-0.1, pose(uniform())), (0.3, pose(uniform()))];
                    let poses = poses.map(|(at, pose)| (Moment::from_seconds(at).expect("finite"), pose));
                    scene.set_trajectory(handle, Trajectory::new(poses.into()).expect("sound"));
                }
                _ => {
                    let turn = UnitQuaternion::new(Vector3::new(uniform(), uniform(), uniform()) * 3.0);
                    let shift = Vector3::new(uniform(), -0.0, uniform() * 1e-12);
                    scene.set_pose(handle, Pose::from_parts(shift.into(), turn));
                }
            }
        }
        let asset = AssetRef { pool: "p".into(), name: "a/b".into() };
        let removed = vec![Removal { spawn: 3, asset, reason: "fell \"off\"".into() }];
        let report = SettleReport { simulated_s: 0.1 + 0.2, residual_speed_m_s: 1e-300, removed, ..Default::default() };
        let settled = Settled::between(&placed, &scene, &report).expect("nothing was added");
        let store = StoreFolder::from(std::sync::Arc::new(syntable_model::store::MemStore::default()));
        write(&store, SceneId(3), &settled).expect("writable");
        let read = read(&store, SceneId(3)).expect("readable");
        let mut again = place();
        assert_eq!(read.apply(&mut again).expect("the same scene"), report);
        assert_eq!(bits(&again), bits(&scene));
        let mut other = table();
        assert!(read.apply(&mut other).is_err(), "another scene");
    }
}
