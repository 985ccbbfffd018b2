//! Light samplers.

mod brightness;
mod ceiling_light;
mod environment;
mod flash;
mod landscape;
mod per;
mod sphere_lights;
mod sun;
mod window_light;

pub use ceiling_light::CeilingLight;
pub use environment::Environment;
pub use flash::Flash;
pub use sphere_lights::SphereLights;
pub use sun::Sun;
pub use window_light::WindowLight;
