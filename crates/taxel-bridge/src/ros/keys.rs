//! Where `rmw_zenoh` expects things: the key expressions of topics and services, and the liveliness tokens by which
//! `ros2 node list`, `ros2 topic list` and `ros2 service list` know that they are there.

use crate::ros::types::RosType;

/// In a key and a token of humble, which knows no hashes.
const NO_HASH: &str = "TypeHashNotSupported";

/// How messages are kept for readers, as a token says it: reliable, volatile, the last so many.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KeepLast(pub u32);

impl KeepLast {
    /// As in a token: reliability, durability, history with depth, deadline, lifespan, liveliness; what is left out is
    /// the default.
    fn text(self) -> String {
        format!("::,{}:,:,:,,", self.0)
    }
}

/// What an endpoint is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EndpointKind {
    /// A publisher of messages.
    Publisher,
    /// A service.
    Service,
}

impl EndpointKind {
    fn text(self) -> &'static str {
        match self {
            Self::Publisher => "MP",
            Self::Service => "SS",
        }
    }
}

/// The ROS graph that is spoken to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Graph {
    /// `ROS_DOMAIN_ID`.
    pub domain: u32,
    /// Whether keys carry the hash of the type; humble's do not.
    pub type_hashes: bool,
}

impl Graph {
    fn hash<T: RosType>(&self) -> String {
        if self.type_hashes { format!("RIHS01_{}", T::HASH) } else { NO_HASH.to_owned() }
    }

    /// The key of the topic or service `name`, an absolute name such as `/skin/left_forearm/wrench`.
    pub fn key<T: RosType>(&self, name: &str) -> String {
        format!("{}/{}/{}/{}", self.domain, name.trim_matches('/'), T::NAME, self.hash::<T>())
    }
}

/// A node of the graph, in one Zenoh session.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Node {
    /// Of which graph.
    pub graph: Graph,
    /// Id of the session, as Zenoh shows it.
    pub session: String,
    /// Absolute, for example `/skin`; `/` for none.
    pub namespace: String,
    /// Its name in the namespace.
    pub name: String,
}

/// A name as one chunk of a token: no slash, and never empty.
fn chunk(name: &str) -> String {
    if name.is_empty() || name == "/" { "%".to_owned() } else { name.replace('/', "%") }
}

impl Node {
    /// The token that says that the node is there. Its own number is 0, since a session of the bridge has one node.
    pub fn token(&self) -> String {
        format!(
            "@ros2_lv/{}/{}/0/0/NN/%/{}/{}",
            self.graph.domain,
            self.session,
            chunk(&self.namespace),
            chunk(&self.name)
        )
    }

    /// The token of its publisher or service number `id`, from 1, of the absolute name `name`.
    pub fn endpoint_token<T: RosType>(&self, id: u32, kind: EndpointKind, name: &str, keeps: KeepLast) -> String {
        format!(
            "@ros2_lv/{}/{}/0/{id}/{}/%/{}/{}/{}/{}/{}/{}",
            self.graph.domain,
            self.session,
            kind.text(),
            chunk(&self.namespace),
            chunk(&self.name),
            chunk(name),
            T::NAME,
            self.graph.hash::<T>(),
            keeps.text()
        )
    }
}

/// Whether ROS takes `text` as one part of a name: letters, digits and underscores, and no digit first.
pub fn is_name(text: &str) -> bool {
    text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
        && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// A patch's name as ROS takes it: what it does not take becomes an underscore.
pub fn name_of(patch: &str) -> String {
    let taken: String = patch.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if is_name(&taken) { taken } else { format!("_{taken}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ros::types::{TriggerResponse, WrenchStamped};

    fn node(type_hashes: bool) -> Node {
        let graph = Graph { domain: 7, type_hashes };
        Node { graph, session: "ab12".into(), namespace: "/skin".into(), name: "taxel_bridge".into() }
    }

    #[test]
    fn keys_are_as_rmw_zenoh_lays_them() {
        let hash = "RIHS01_8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77";
        assert_eq!(
            node(true).graph.key::<WrenchStamped>("/skin/left_forearm/wrench"),
            format!("7/skin/left_forearm/wrench/geometry_msgs::msg::dds_::WrenchStamped_/{hash}")
        );
        assert_eq!(
            node(false).graph.key::<TriggerResponse>("/skin/tare"),
            "7/skin/tare/std_srvs::srv::dds_::Trigger_/TypeHashNotSupported"
        );
    }

    #[test]
    fn tokens_are_as_rmw_zenoh_reads_them() {
        let node = node(false);
        assert_eq!(node.token(), "@ros2_lv/7/ab12/0/0/NN/%/%skin/taxel_bridge");
        let without = Node { namespace: "/".into(), ..node.clone() };
        assert_eq!(without.token(), "@ros2_lv/7/ab12/0/0/NN/%/%/taxel_bridge");
        assert_eq!(
            node.endpoint_token::<WrenchStamped>(3, EndpointKind::Publisher, "/skin/arm/wrench", KeepLast(1)),
            "@ros2_lv/7/ab12/0/3/MP/%/%skin/taxel_bridge/%skin%arm%wrench/geometry_msgs::msg::dds_::WrenchStamped_/\
             TypeHashNotSupported/::,1:,:,:,,"
        );
        assert!(
            node.endpoint_token::<TriggerResponse>(4, EndpointKind::Service, "/skin/tare", KeepLast(10))
                .contains("/0/4/SS/%/%skin/taxel_bridge/%skin%tare/std_srvs::srv::dds_::Trigger_/")
        );
    }

    #[test]
    fn a_patch_has_a_name_that_ros_takes() {
        for (patch, name) in [("left_forearm", "left_forearm"), ("l-arm 2", "l_arm_2"), ("2nd", "_2nd"), ("", "_")] {
            assert_eq!(name_of(patch), name);
            assert!(is_name(name));
        }
        assert!(!is_name("") && !is_name("a/b") && !is_name("1a") && !is_name("\u{e9}"));
    }
}
