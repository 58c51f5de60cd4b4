// Wavefront MTL: of each material its diffuse colour, its opacity and its diffuse image, and the names of all images.
#include "mesh_readers.h"
#include "text_scanner.h"

#include <string>
#include <unordered_set>

namespace unseen::meshio {

namespace {

class MtlReader {
public:
    MtlReader(std::string_view bytes, const std::string& name, bool with_images, MtlContents& contents)
        : bytes_(bytes), name_(name), with_images_(with_images), contents_(contents), materials_(contents.materials) {
        for (const Material& m : materials_) names_.insert(m.name);
    }

    Result<void> read() {
        if (const std::size_t nul = bytes_.find('\0'); nul != std::string_view::npos)
            return bad(line_number(bytes_, nul),
                       "a NUL byte, which no MTL text contains; the file is damaged or no MTL file.");
        LineScanner lines(bytes_);
        std::string_view rest;
        while (lines.next(rest)) {
            const std::string_view keyword = take_word(rest);
            if (keyword.empty() || keyword.front() == '#') continue;
            if (keyword == "newmtl") {
                begin(trimmed(rest));
                continue;
            }
            if (names_image(keyword)) note_image(rest);
            if (!is_open_) continue; // before the first material, or in one that was there before
            Result<void> done;
            if (keyword == "Kd") done = read_colour(rest, lines.line());
            else if (keyword == "d") done = read_alpha(rest, lines.line(), false);
            else if (keyword == "Tr") done = read_alpha(rest, lines.line(), true);
            else if (keyword == "map_Kd" && with_images_) done = read_image(rest, lines.line());
            if (!done) return done;
        }
        return {};
    }

private:
    Error bad(std::uint64_t line, const std::string& what) const {
        return {ErrorCode::malformed_data, name_ + ": line " + std::to_string(line) + ": " + what};
    }
    Material& material() { return materials_.back(); }

    void begin(std::string_view name) {
        is_open_ = names_.emplace(name).second;
        if (is_open_) materials_.push_back({.name = std::string(name)});
    }

    // A number from 0 to 1, with which a line begins.
    bool take_share(std::string_view& rest, double& value) const {
        return to_number(take_word(rest), value) && value >= 0 && value <= 1;
    }

    // Kd R G B; one number means grey. Spectra and CIE XYZ are left alone.
    Result<void> read_colour(std::string_view rest, std::uint64_t line) {
        const std::string_view all = trimmed(rest);
        if (all.starts_with("spectral") || all.starts_with("xyz")) return {};
        double r = 0, g = 0, b = 0;
        bool is_valid = take_share(rest, r);
        const bool is_grey = trimmed(rest).empty();
        is_valid = is_valid && (is_grey || (take_share(rest, g) && take_share(rest, b)));
        if (!is_valid)
            return bad(line, "the colour of material " + in_quotes(material().name) +
                                 " should be 3 numbers from 0 to 1, not " + in_quotes(all) + "; correct it.");
        if (is_grey) g = b = r;
        const glm::vec4 decoded =
            decode_colour(glm::vec4(r, g, b, 1), ColourEncoding::srgb); // as painting programs mean it
        material().colour = {decoded.r, decoded.g, decoded.b, material().colour.a};
        return {};
    }

    Result<void> read_alpha(std::string_view rest, std::uint64_t line, bool is_transparency) {
        const std::string_view all = trimmed(rest);
        double value = 0;
        if (all.starts_with("-halo")) take_word(rest);
        if (!take_share(rest, value))
            return bad(line, "the opacity of material " + in_quotes(material().name) +
                                 " should be a number from 0 to 1, not " + in_quotes(all) + "; correct it.");
        material().colour.a = static_cast<float>(is_transparency ? 1 - value : value);
        return {};
    }

    static bool names_image(std::string_view keyword) {
        return keyword.starts_with("map_") || keyword == "bump" || keyword == "disp" || keyword == "decal" ||
               keyword == "norm" || keyword == "refl";
    }

    // [-option values ...] FILE; leaves the name, which may have blanks. Calls f(option, its last value) for each.
    template <class F>
    static void skip_options(std::string_view& rest, F&& f) {
        while ((rest = trimmed(rest)).starts_with('-')) {
            const std::string_view option = take_word(rest);
            std::string_view value;
            if (option == "-s" || option == "-o" || option == "-t") {
                double number = 0;
                for (std::string_view next = rest; to_number(take_word(next), number);) rest = next; // one to three
            } else {
                if (option == "-mm") take_word(rest);
                value = take_word(rest); // -blendu, -blendv, -bm, -cc, -boost, -imfchan, -texres, -type: one value
            }
            f(option, value);
        }
    }

    // Any image, for who copies it.
    void note_image(std::string_view rest) {
        skip_options(rest, [](std::string_view, std::string_view) {});
        if (const auto path = path_beside(rest)) contents_.images.insert(*path);
    }

    Result<void> read_image(std::string_view rest, std::uint64_t line) {
        Material& m = material();
        m.wrap_u = m.wrap_v = Wrap::repeat;
        skip_options(rest, [&](std::string_view option, std::string_view value) {
            if (option == "-clamp") m.wrap_u = m.wrap_v = value == "on" ? Wrap::clamp : Wrap::repeat;
            if (option == "-s" || option == "-o" || option == "-t")
                contents_.warnings.push_back(name_ + ": line " + std::to_string(line) + ": " + in_quotes(option) +
                                             " of an image was ignored.");
        });
        if (rest.empty())
            return bad(line, "material " + in_quotes(m.name) + " names no image; add it or remove the line.");
        const auto path = path_beside(rest);
        if (!path)
            return bad(line, "the image of material " + in_quotes(m.name) + " is " + in_quotes(rest) +
                                 ", and only files beside the mesh are read; move it there.");
        m.image = *path;
        return {};
    }

    std::string_view bytes_;
    const std::string& name_;
    const bool with_images_;
    MtlContents& contents_;
    std::vector<Material>& materials_;
    std::unordered_set<std::string> names_; // of all materials so far
    bool is_open_ = false;
};

} // namespace

Result<void> read_mtl(std::string_view bytes, const std::string& name, bool with_images, MtlContents& contents) {
    return MtlReader(bytes, name, with_images, contents).read();
}

} // namespace unseen::meshio
