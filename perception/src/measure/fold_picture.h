// What a fold changes, as a small picture: the mesh's own surface and the folded one, seen along the node's normal, and
// how much of the difference of their luminances lies in which band of spatial frequency.
#pragma once

#include <limits>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "measure/measurement.h"

namespace unseen::perception {

// What is measured of several luminances at once fills whole registers.
constexpr std::size_t luminances_kept(std::size_t count) { return count == 1 ? 1 : count <= 5 ? 5 : 9; }

template <std::size_t count>
struct alignas(16) LitPointOf { // one register, two or three
    glm::vec3 position;
    float luminance[luminances_kept(count)];
};
using LitPoint = LitPointOf<1>;

// With so many luminances in every point. The pictures are there for each; what lies where is the same for all.
template <std::size_t count>
class FoldPictureOf {
public:
    using LitPoint = LitPointOf<count>;
    static constexpr std::size_t side = measurement::picture_side;   // cells
    static constexpr std::size_t bands = measurement::picture_bands; // an octave each, the finest first

    // Looks against the normal, a unit vector, at a square of `half_width`, mesh units, to each side of the centre.
    // Nothing is seen yet.
    void look(glm::vec3 centre, glm::vec3 normal, float half_width);

    // Where a point lies for this picture, and for others with its centre and normal.
    struct alignas(16) Place {
        float right, up, height; // from the centre, mesh units
        float luminance[luminances_kept(count)];
    };
    Place place(const LitPoint& point) const;

    // Draws a triangle of one of the surfaces, whichever way it is turned; what lies highest along the normal is seen.
    enum class Layer { mesh, folded };
    void draw(Layer layer, const Place& a, const Place& b, const Place& c);
    void draw(Layer layer, const LitPoint& a, const LitPoint& b, const LitPoint& c) {
        draw(layer, place(a), place(b), place(c));
    }
    void clear(Layer layer);

    // Whether all that was drawn since look() is turned to one side: then nothing is hidden under something else.
    bool is_height_field() const { return !(has_front_ && has_back_); }

    // How the two differ where both are seen.
    struct Difference {
        // The largest difference of the luminances in each band, as the amplitude of a grating of the band's own
        // frequency. Bands are those of a Laplacian pyramid: the lowest has waves longer than the picture.
        std::array<std::array<float, bands>, count> amplitudes; // by luminance
        // The largest difference of their heights, mesh units, in the mean over some cells, as outlines are seen.
        float shift;
    };
    // Compares only the first `compared` luminances, each band's difference times its cell's weight; null: 1.
    using Cells = std::array<float, side * side>;
    using BandCells = std::array<Cells, bands>;
    Difference difference(std::size_t compared = count, const BandCells* weights = nullptr) const;
    float wavelength(std::size_t band) const; // mesh units

    // What lies in the cells, to be changed before it is compared.
    struct Picture {
        std::array<Cells, count> luminance;
        Cells height; // none: nothing is seen
    };
    Picture& picture(Layer layer) { return pictures_[static_cast<std::size_t>(layer)]; }
    static bool is_seen(float height) { return height > -std::numeric_limits<float>::infinity(); }
    // The means that bands are differences from, of values where a layer is seen; negative where too little of it is.
    void find_means(Layer layer, const Cells& values, BandCells& means) const;
    // The largest mean over some cells, as outlines are seen, of values where both layers are.
    float largest_mean(const Cells& values) const;

private:
    glm::vec3 centre_;
    glm::mat3 axes_; // right, up, normal
    float cell_ = 1; // mesh units
    bool has_front_ = false, has_back_ = false;
    std::array<Picture, 2> pictures_; // by layer
};
using FoldPicture = FoldPictureOf<1>;
extern template class FoldPictureOf<1>;
extern template class FoldPictureOf<3>;
extern template class FoldPictureOf<4>;
extern template class FoldPictureOf<5>;
extern template class FoldPictureOf<6>;

} // namespace unseen::perception
