// What the other members of a team do while member 0 clusters.
#pragma once

#include <unseen/vdtree/builder.h>

namespace unseen::vdtree {

// The part of cluster_quadric(input, progress, &team) that falls to a member other than 0. The input must be the same.
Result<void> help_cluster_quadric(const ClusterInput& input, Team& team);

} // namespace unseen::vdtree
