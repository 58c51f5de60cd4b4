// How folds are measured: what decides how fine and how dear a measurement is. The numbers are kept with it, and a
// criterion refuses those of a measurement with others. Factors that a criterion applies stand in
// perception/criterion.h.
//
// Where a comment does not say otherwise, a number was chosen by trial: larger ones cost more and changed little on the
// meshes of the tests. None was fitted, and there is no script that finds them again.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace unseen::perception::measurement {

inline constexpr int revision = 10; // one more where the same settings give other numbers

// ---- points
// Leaves of a node for its parent: the worst in distance, the worst in luminance.
inline constexpr std::size_t witness_count = 4;
inline constexpr std::uint32_t spread_count = 8;          // leaves compared besides, at equal steps through the support
inline constexpr std::size_t triangles_compared = 16;     // of each surface, at equal steps
inline constexpr std::uint32_t most_wedges_compared = 16; // of a child: poles have as many as triangles
// Points this many times farther than heights change lie beside the ring, where a triangle is turned over: then the
// triangles around count, too. A cone's tip is 1.3 times as far as the mean.
inline constexpr float beside_the_ring = 4;
// Corners of triangles around that are looked at, at most, and for each leaf of the node: neighbours are about as large as
// the node, but for hubs.
inline constexpr std::uint32_t most_around = 1u << 15, around_a_leaf = 2048;
inline constexpr unsigned no_sheet = 0xffff; // of triangles around a ring
// A share of the width that a fold changes. Surfaces whose distances from a point differ by less meet at a seam, and the
// point's own side counts. Some hundred times what rounding makes of distances.
inline constexpr float seam_width = 1e-3f;
inline constexpr std::size_t most_fine_triangles = 64; // in rings of more, some neighbours are folded
// Neighbours with more than so many times the node's luminance range fold later than it: they are not folded with it.
inline constexpr int much_more = 2;
// Neighbours fold earlier, however large they are, where all that they can change is this many times less than all that
// the node can: both luminance times area, and heights.
inline constexpr float much_less = 4;
// Trees are some tens of nodes deep. Up deeper ones, as only made-up ones are, neighbours are folded no farther than
// this, so that no tree costs the square of its depth.
inline constexpr int most_steps = 1024;
inline constexpr std::size_t most_stand_ins = 16; // nodes, each above the last, that may stand for a leaf
inline constexpr std::size_t most_border_ends =
    4096; // of edges of the mesh's own border; of more, these at equal steps
// Looks at the mesh's own border for one node: this many, and this many for each of its edges there and each triangle
// around it. Twice what any mesh took whose parts do not lie through each other. After them shifts are taken as too
// large, for the nodes above, too, which would look at the same. Not kept with a measurement.
inline constexpr std::size_t most_border_looks = 1u << 16;
inline constexpr std::size_t border_looks_an_edge = 256;
// Nodes near a border that lie each in the next: 40 in trees of foliage. Above more, nothing is looked at, either.
inline constexpr int most_border_levels = 256;

// ---- rings narrower than pictures' cells
inline constexpr std::size_t sliver_slices = 8; // of the length, in which light is added up

// ---- pictures of a fold
inline constexpr std::size_t picture_side = 16;           // cells
inline constexpr std::size_t picture_bands = 4;           // an octave each, the finest first
inline constexpr std::size_t most_triangles_drawn = 4096; // of the mesh's own; in place of more, those of the children
// Half of a picture's side, in widths of what changes. Half an octave apart, so that nothing lies between bands.
inline constexpr std::array<float, 2> picture_sizes = {1.5f, 2.1f};

// ---- what lies over the surface and is not drawn (TextureDetail::stand_in)
// Measured on images of 2048 texels a side, as root mean square contrasts of the four finest octaves. The base colours of
// three controllers and a helmet have 0.04 to 0.25, with a median of 0.1. The helmet's normal map under a light has 0.03
// to 0.04, and more than 0.1 in a tenth of the places.
inline constexpr float usual_contrast = 0.1f;        // of an octave
inline constexpr std::uint32_t stand_in_side = 1024; // texels over the range 0..1 of coordinates
inline constexpr std::size_t stand_in_octaves = 8;   // the finest; wider patterns are the parts of an atlas

// ---- shifts of the mean (luminance_bias.cpp)
inline constexpr float levels_per_octave = 1; // of the order in which nodes fold
inline constexpr int most_levels = 40;
// The share of a surface's area that its vector area must reach; else its parts count without cancelling.
inline constexpr float flat_share = 0.5f;
inline constexpr float spread = 1; // standard deviations by which what is folded may differ from all that could be
inline constexpr float least_contrast = 2e-3f; // relative luminance: below, errors do not order the folds any more
inline constexpr float darkest = 0.01f;        // relative luminance of areas; about a display's black
inline constexpr float least_side = 0.25f;     // of a surface's area, as seen: less is not what the mean is taken of
// Ancestors of a node that are looked at, from the nearest on: trees may be as deep as they have vertices.
inline constexpr int most_ancestors = 4096;

// ---- pictures of the whole mesh, in stages (find_stages.cpp)
inline constexpr std::size_t stage_side = 128; // of pictures, in cells
// Samples along each side of a cell; with one, what single samples jump by at outlines hides what folds change.
inline constexpr std::size_t cell_samples = 4;
inline constexpr float stage_margin = 1.05f; // of the picture around the mesh's sphere: proxies may stand out of it
inline constexpr std::size_t direction_count = 26;
// The share of nodes that the first stage leaves; finer ones are for near views, which go by other errors.
inline constexpr double first_share = 0.8;
inline constexpr double stages_per_halving = 2;
inline constexpr double fewest_left = 4; // nodes; then all fold
// The contrast of a typical outline: what a distance between surfaces changes of the light.
inline constexpr float outline_contrast = 0.6f;

// What is kept with a measurement.
inline constexpr auto settings = std::to_array<float>({revision,
                                                       witness_count,
                                                       spread_count,
                                                       triangles_compared,
                                                       most_wedges_compared,
                                                       beside_the_ring,
                                                       most_around,
                                                       around_a_leaf,
                                                       seam_width,
                                                       most_fine_triangles,
                                                       much_more,
                                                       much_less,
                                                       most_steps,
                                                       most_stand_ins,
                                                       most_border_ends,
                                                       picture_side,
                                                       picture_bands,
                                                       most_triangles_drawn,
                                                       picture_sizes[0],
                                                       picture_sizes[1],
                                                       usual_contrast,
                                                       stand_in_side,
                                                       stand_in_octaves,
                                                       levels_per_octave,
                                                       most_levels,
                                                       flat_share,
                                                       spread,
                                                       least_contrast,
                                                       darkest,
                                                       least_side,
                                                       most_ancestors,
                                                       stage_side,
                                                       cell_samples,
                                                       stage_margin,
                                                       direction_count,
                                                       static_cast<float>(first_share),
                                                       static_cast<float>(stages_per_halving),
                                                       static_cast<float>(fewest_left),
                                                       outline_contrast});

} // namespace unseen::perception::measurement
