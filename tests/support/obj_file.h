// OBJ files, read by code of the tests' own.
#pragma once

#include <array>
#include <map>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace unseen::support {

struct ObjContents {
    // A corner's position, texture coordinates and normal by number, from 0 on; -1: it has none.
    using Corner = std::array<long, 3>;
    static constexpr const char* keywords[] = {"v", "vt", "vn"};

    std::map<std::string, std::vector<std::vector<double>>> vectors; // by keyword
    std::map<std::string, std::vector<std::vector<Corner>>> faces;   // by the names of object, group and material

    // The values of all corners, as text.
    std::map<std::string, std::multiset<std::string>> corners() const {
        std::map<std::string, std::multiset<std::string>> out;
        for (const auto& [name, of_part] : faces)
            for (const std::vector<Corner>& face : of_part)
                for (const Corner& corner : face) {
                    std::ostringstream values;
                    for (std::size_t list = 0; list < 3; ++list) {
                        if (corner[list] < 0) values << "- ";
                        else
                            for (const double value : vector(list, corner[list])) values << value << ' ';
                    }
                    out[name].insert(values.str());
                }
        return out;
    }

    const std::vector<double>& vector(std::size_t list, long number) const {
        return vectors.at(keywords[list]).at(static_cast<std::size_t>(number));
    }
};

inline ObjContents read_obj(const std::string& text) {
    ObjContents out;
    std::map<std::string, std::string> names;
    std::istringstream in(text);
    for (std::string line; std::getline(in, line);) {
        std::istringstream words(line);
        std::string keyword, word;
        words >> keyword;
        if (keyword == "v" || keyword == "vt" || keyword == "vn") {
            std::vector<double>& values = out.vectors[keyword].emplace_back();
            for (double value = 0; words >> value;) values.push_back(value);
        } else if (keyword == "o" || keyword == "g" || keyword == "usemtl") {
            words >> names[keyword];
        } else if (keyword == "f") {
            std::vector<ObjContents::Corner>& face =
                out.faces[names["o"] + " " + names["g"] + " " + names["usemtl"]].emplace_back();
            while (words >> word) {
                ObjContents::Corner& corner = face.emplace_back(ObjContents::Corner{-1, -1, -1});
                std::istringstream numbers(word);
                for (long& number : corner)
                    if (std::getline(numbers, word, '/') && !word.empty()) number = std::stol(word) - 1;
            }
            if (face.size() < 3) throw std::runtime_error("a face of fewer than three corners: " + line);
        }
    }
    return out;
}

} // namespace unseen::support
