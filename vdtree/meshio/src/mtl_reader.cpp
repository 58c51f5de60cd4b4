// Wavefront MTL: of each material its diffuse colour, its opacity and its emission, with the images of these and of normals,
// and the names of all images.
#include "mtl_reader.h"
#include "text_scanner.h"

#include <unordered_set>

namespace unseen::meshio {

namespace {

class MtlReader {
public:
    MtlReader(std::string_view bytes, const std::string& name, const FunctionRef<NamedFile(std::string_view)>& find,
              const std::filesystem::path& folder, MtlContents& contents)
        : bytes_(bytes), name_(name), find_(find), folder_(folder), contents_(contents) {
        for (const Material& m : contents_.materials) names_.insert(m.name);
        for (const NamedFile& image : contents_.images) uris_.insert(image.uri);
    }

    std::string read() {
        LineScanner lines(bytes_);
        std::string_view rest;
        while (lines.next(rest)) {
            const std::string_view keyword = take_word(rest);
            if (keyword.empty() || keyword.front() == '#') continue;
            line_ = lines.line();
            if (keyword == "newmtl") begin(trimmed(rest));
            else if (names_image(keyword)) {
                if (is_open_) note_undrawn(keyword);
                read_image(rest, keyword);
            } else if (!is_open_) continue; // before the first material, or in one that was there before
            else if (keyword == "Kd") read_colour(rest);
            else if (keyword == "d") read_alpha(rest, false);
            else if (keyword == "Tr") read_alpha(rest, true);
            else if (keyword == "Ke") read_emission(rest);
        }
        for (Material& m : contents_.materials) // Ke may stand behind map_Ke
            if (dark_.contains(m.name)) m.emission = glm::vec3(0);
        if (odd_lines_ > 0)
            contents_.warnings.push_back(name_ + ": " + first_odd_ +
                                         (odd_lines_ == 1 ? "."
                                                          : "; " + std::to_string(odd_lines_ - 1) + " more such " +
                                                                (odd_lines_ == 2 ? "line." : "lines.")));
        return text_.append(bytes_.substr(copied_));
    }

private:
    Material& material() { return contents_.materials.back(); }

    void note_odd(const std::string& what) {
        if (odd_lines_++ == 0) first_odd_ = "line " + std::to_string(line_) + ": " + what;
    }

    void begin(std::string_view name) {
        is_open_ = names_.emplace(name).second;
        if (is_open_) contents_.materials.push_back({.name = std::string(name)});
    }

    void note_undrawn(std::string_view keyword) {
        constexpr std::pair<std::string_view, const char*> names[] = {
            {"map_Bump", "bump maps"}, {"map_bump", "bump maps"}, {"bump", "bump maps"}};
        for (const auto& [word, what] : names)
            if (keyword == word) material().undrawn.insert(what);
    }

    void read_emission(std::string_view rest) {
        std::array<double, 3> rgb{};
        if (!take_shares(rest, rgb))
            return note_odd("the emission of material " + in_quotes(material().name) +
                            " should be 3 numbers, and was left out");
        const glm::vec4 decoded = decode_colour(glm::vec4(rgb[0], rgb[1], rgb[2], 1), ColourEncoding::srgb);
        material().emission = glm::vec3(decoded);
    }

    // Numbers from 0 to 1, with which a line begins; those beyond are clamped. False if there is another word.
    bool take_shares(std::string_view& rest, std::span<double> values) {
        for (double& value : values) {
            double given = 0;
            if (!to_number(take_word(rest), given) || std::isnan(given)) return false;
            value = std::clamp(given, 0.0, 1.0);
            if (value != given)
                note_odd("values of material " + in_quotes(material().name) + " beyond 0..1 were clamped");
        }
        return true;
    }

    // Kd R G B; one number means grey. Spectra and CIE XYZ are left alone.
    void read_colour(std::string_view rest) {
        const std::string_view all = trimmed(rest);
        if (all.starts_with("spectral") || all.starts_with("xyz")) return;
        std::array<double, 3> rgb{};
        const std::span values(rgb);
        bool is_valid = take_shares(rest, values.first(1));
        const bool is_grey = trimmed(rest).empty();
        is_valid = is_valid && (is_grey || take_shares(rest, values.last(2)));
        if (!is_valid)
            return note_odd("the colour of material " + in_quotes(material().name) + " should be 3 numbers, not " +
                            in_quotes(all) + ", and was left out");
        if (is_grey) rgb[1] = rgb[2] = rgb[0];
        const glm::vec4 decoded =
            decode_colour(glm::vec4(rgb[0], rgb[1], rgb[2], 1), ColourEncoding::srgb); // as painting programs mean it
        material().colour = {decoded.r, decoded.g, decoded.b, material().colour.a};
    }

    void read_alpha(std::string_view rest, bool is_transparency) {
        const std::string_view all = trimmed(rest);
        double value = 0;
        if (all.starts_with("-halo")) take_word(rest);
        if (!take_shares(rest, {&value, 1}))
            return note_odd("the opacity of material " + in_quotes(material().name) + " should be a number, not " +
                            in_quotes(all) + ", and was left out");
        material().colour.a = static_cast<float>(is_transparency ? 1 - value : value);
        material().blends = material().colour.a < 1;
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

    // All images are kept; those that are drawn are the material's.
    void read_image(std::string_view rest, std::string_view keyword) {
        const bool is_colour = is_open_ && keyword == "map_Kd";
        std::shared_ptr<const std::string>* const further = !is_open_             ? nullptr
                                                            : keyword == "map_d"  ? &material().opacity_map
                                                            : keyword == "map_Ke" ? &material().emission_map
                                                            : keyword == "norm"   ? &material().normal_map
                                                                                  : nullptr;
        Wrap wrap = Wrap::repeat;
        skip_options(rest, [&](std::string_view option, std::string_view value) {
            if (option == "-clamp") wrap = value == "on" ? Wrap::clamp : Wrap::repeat;
            if ((is_colour || further) && (option == "-s" || option == "-o" || option == "-t" || option == "-bm"))
                note_odd(in_quotes(option) + " of an image was ignored");
        });
        if (rest.empty()) {
            if (is_colour) note_odd("material " + in_quotes(material().name) + " names no image");
            return;
        }
        NamedFile image = find_(rest);
        if (is_colour) {
            material().wrap_u = material().wrap_v = wrap;
            material().image = image.uri.empty() ? std::string(rest) : image.uri;
            material().image_bytes = image.bytes;
        }
        if (further) *further = image.bytes;
        if (keyword == "map_Ke" && further && !image.bytes) dark_.insert(material().name);
        if (!image.bytes) {
            contents_.lost.add(image.why);
            if (is_colour || further) contents_.lost.materials.insert(material().name);
            return;
        }
        rename(rest, image.uri);
        if (uris_.insert(image.uri).second) contents_.images.push_back(std::move(image));
    }

    // An image that lies elsewhere is written beside the library, and so is named otherwise there.
    void rename(std::string_view name, const std::filesystem::path& uri) {
        const auto path = plain_path(name);
        if (path && (*path == uri || (folder_ / *path).lexically_normal() == uri)) return;
        const auto at = static_cast<std::size_t>(name.data() - bytes_.data());
        text_.append(bytes_.substr(copied_, at - copied_))
            .append(uri.lexically_relative(folder_.empty() ? "." : folder_).generic_string());
        copied_ = at + name.size();
    }

    std::string_view bytes_;
    const std::string& name_;
    const FunctionRef<NamedFile(std::string_view)>& find_;
    const std::filesystem::path& folder_;
    MtlContents& contents_;
    std::unordered_set<std::string> names_, uris_; // of all materials and images so far
    std::unordered_set<std::string> dark_;         // materials whose image of emission was not found
    bool is_open_ = false;
    std::uint64_t line_ = 0, odd_lines_ = 0;
    std::string first_odd_;
    std::string text_; // what is written again, of the bytes up to ...
    std::size_t copied_ = 0;
};

} // namespace

std::string read_mtl(std::string_view bytes, const std::string& name,
                     const FunctionRef<NamedFile(std::string_view)>& find, const std::filesystem::path& folder,
                     MtlContents& contents) {
    return MtlReader(bytes, name, find, folder, contents).read();
}

} // namespace unseen::meshio
