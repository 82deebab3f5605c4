//! How much of a list one answer has.

use taxel_proto::v1::ListRequest;
use tonic::Status;

use crate::status::invalid;

const MOST: u32 = 1_000;

/// So many items at most, and only those with a number below the second.
pub(crate) fn part(request: &ListRequest) -> Result<(usize, u64), Status> {
    let before = if request.before == 0 { u64::MAX } else { request.before };
    match request.most {
        0 => Ok((MOST as usize, before)),
        most if most <= MOST => Ok((most as usize, before)),
        most => Err(invalid("most", format_args!("{most} is not in 0 to {MOST}"))),
    }
}
