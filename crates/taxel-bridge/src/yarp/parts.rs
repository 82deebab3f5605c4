//! The numbers under which iCub's programs know a part of the body.

/// Body part: torso 1, head 2, left arm 3, right arm 4, left leg 5, right leg 6; link of its kinematic chain; skin part: left hand 1,
/// forearm 2, upper arm 3; right 4, 5, 6; chest 7; left upper leg 8, lower leg 9, foot 10; right 11, 12, 13.
pub type Part = [i64; 3];

/// Names as on the robots' skin ports.
const PARTS: [(&str, Part); 16] = [
    ("torso", [1, 2, 7]),
    ("chest", [1, 2, 7]),
    ("left_hand", [3, 6, 1]),
    ("left_forearm", [3, 4, 2]),
    ("left_arm", [3, 2, 3]),
    ("left_upper_arm", [3, 2, 3]),
    ("right_hand", [4, 6, 4]),
    ("right_forearm", [4, 4, 5]),
    ("right_arm", [4, 2, 6]),
    ("right_upper_arm", [4, 2, 6]),
    ("left_upper_leg", [5, 0, 8]),
    ("left_lower_leg", [5, 0, 9]),
    ("left_foot", [5, 0, 10]),
    ("right_upper_leg", [6, 0, 11]),
    ("right_lower_leg", [6, 0, 12]),
    ("right_foot", [6, 0, 13]),
];

/// The part of this name, if it is one of iCub's.
pub fn named(name: &str) -> Option<Part> {
    PARTS.iter().find(|(part, _)| *part == name).map(|(_, numbers)| *numbers)
}
