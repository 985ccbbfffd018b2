//! The models of depth cameras that have published figures.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Model of a depth camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Model {
    /// Intel RealSense L515, scanning time of flight: 0.25 to 9 m, unit 0.25 mm; on a 95 % surface without ambient light
    /// a standard deviation of 2.5 mm at 1 m and 15.5 mm at 9 m. Sources: range and noise from Intel's product page and
    /// data sheet, for 640 × 480, as quoted in librealsense issues 5808, 7040, 7236 and 8947; the unit from Intel's
    /// support, issue 8058. No source was found for the 3.9 m up to which a 15 % surface is seen; from the 9 m on 95 %
    /// the inverse square of the distance gives 3.6 m.
    #[default]
    L515,
    /// Intel RealSense D435, active stereo at 848 × 480: baseline 50 mm, horizontal field of view 87° (a focal length
    /// of 447 px), 0.18 to 10 m, unit 1 mm; disparities in steps of 1/32 px with an error of 0.08 px. Sources: field of
    /// view from Intel's D400 data sheet of May 2020, table 3-42; baseline, unit and farthest depth as quoted in
    /// librealsense issues 10575, 8058 and 7996; the nearest depth is f b over the 126 px that are searched (issue 3039;
    /// Intel's A. Grunnet-Jepsen says 17 cm in issue 999), at 1280 × 720 it would be 0.27 m; the error from the same,
    /// issue 3904; the steps from Intel's white paper on subpixel linearity.
    D435,
    /// Microsoft Azure Kinect, time of flight, narrow field of view, not binned: 0.5 to 3.86 m, unit 1 mm, a standard
    /// deviation of at most 17 mm, taken here for a 15 % surface at 3.86 m; on a 95 % surface 1 mm at 1 m and 3 mm at 3
    /// m. Sources: range and unit from Microsoft's pages "Azure Kinect DK hardware specifications" and "Azure Kinect DK
    /// depth camera"; the 17 mm are theirs too, confirmed by Tölgyessy et al. (Sensors 21, 413, 2021); the noise on
    /// bright surfaces follows BlenderProc's code, which cites them: 0.5 mm, and 1 mm for every meter beyond 0.5 m.
    AzureKinect,
}

impl Model {
    /// Name in recipes and in the output.
    pub fn name(self) -> &'static str {
        match self {
            Self::L515 => "l515",
            Self::D435 => "d435",
            Self::AzureKinect => "azure_kinect",
        }
    }
}
