// What is the same in every cycle: neighbours, and what the sums over the taxels weigh with. See runtime/geometry.py.
#pragma once

#include "polygon.hpp"
#include "types.hpp"

namespace skin_calib {

using Mat2 = std::array<Vec2, 2>;

inline Mat2 product(const Mat2& a, const Mat2& b) {
    Mat2 c{};
    for (int i = 0; i < 2; ++i)
        for (int j = 0; j < 2; ++j) c[i][j] = a[i][0] * b[0][j] + a[i][1] * b[1][j];
    return c;
}

inline Vec2 product(const Mat2& a, const Vec2& v) {
    return {a[0][0] * v[0] + a[0][1] * v[1], a[1][0] * v[0] + a[1][1] * v[1]};
}

// Eigenvalues of a symmetric matrix, the larger one first, and the unit vector of the larger one.
struct Eigen2 {
    double large, small;
    Vec2 axis;

    explicit Eigen2(const Mat2& m) {
        const double mean = (m[0][0] + m[1][1]) / 2, half = (m[0][0] - m[1][1]) / 2;
        const double radius = std::hypot(half, m[0][1]);
        large = mean + radius;
        small = large > 0 ? (m[0][0] * m[1][1] - m[0][1] * m[0][1]) / large : 0.0;
        const double angle = std::atan2(m[0][1], half) / 2;
        axis = {std::cos(angle), std::sin(angle)};
    }
};

// Return the pseudo-inverse of a symmetric positive matrix; eigenvalues up to `smallest` of the larger one count as 0.
inline Mat2 pseudo_inverse(const Mat2& m, double smallest) {
    const Eigen2 e(m);
    const auto [x, y] = e.axis;
    const double first = e.large > 0 ? 1 / e.large : 0.0, second = e.small > smallest * e.large ? 1 / e.small : 0.0;
    const double mixed = (first - second) * x * y;
    return {{{first * x * x + second * y * y, mixed}, {mixed, first * y * y + second * x * x}}};
}

// Return the second moments of a cell about the origin, per area [m^2].
inline Mat2 second_moments(const std::vector<Vec2>& corners) {
    Mat2 sum{};
    double area = 0;
    for (std::size_t k = 0; k < corners.size(); ++k) {
        const Vec2 &a = corners[k], &b = corners[k + 1 < corners.size() ? k + 1 : 0];
        const double twice = a[0] * b[1] - a[1] * b[0];
        area += twice;
        for (int i = 0; i < 2; ++i)
            for (int j = 0; j < 2; ++j)
                sum[i][j] += twice * ((a[i] * a[j] + b[i] * b[j]) * 2 + a[i] * b[j] + b[i] * a[j]);
    }
    for (auto& row : sum)
        for (double& x : row) x = area == 0 ? 0.0 : x / (12 * area);
    return sum;
}

// Taxels of one link, with their neighbours.
struct SkinGeometry {
    using LinkTerms = std::array<double, 11>;

    std::size_t n = 0;
    Calibration calibration;
    Rows neighbours,
        first; // neighbours of taxel i are in [first[i], first[i + 1]): the higher rows, then the lower ones
    std::size_t most_neighbours = 0;
    Vec6 mean_wrench{};           // of 1 N on all taxels
    std::vector<LinkTerms> terms; // of a force of 1 N: 1, position, height of the tangent plane, wrench about the link

    SkinGeometry() = default;

    explicit SkinGeometry(const Calibration& c) : n(c.ids.size()), calibration(c) {
        std::vector<Rows> higher(n), lower(n);
        for (const auto& [i, j] : c.pairs) {
            higher[static_cast<std::size_t>(i)].push_back(j);
            lower[static_cast<std::size_t>(j)].push_back(i);
        }
        for (std::size_t i = 0; i < n; ++i) {
            first.push_back(static_cast<std::int32_t>(neighbours.size()));
            neighbours.insert(neighbours.end(), higher[i].begin(), higher[i].end());
            neighbours.insert(neighbours.end(), lower[i].begin(), lower[i].end());
            most_neighbours = std::max(most_neighbours, higher[i].size() + lower[i].size());
            const Vec3 &p = c.positions[i], f = plus({0, 0, 0}, c.normals[i], -1), m = cross(p, f);
            terms.push_back({1, p[0], p[1], p[2], dot(c.normals[i], p), f[0], f[1], f[2], m[0], m[1], m[2]});
            for (std::size_t k = 0; k < 6; ++k) mean_wrench[k] += terms.back()[5 + k] / static_cast<double>(n);
        }
        first.push_back(static_cast<std::int32_t>(neighbours.size()));
    }

    std::size_t begin(std::size_t i) const noexcept { return static_cast<std::size_t>(first[i]); }

    std::size_t end(std::size_t i) const noexcept { return static_cast<std::size_t>(first[i + 1]); }

    std::size_t neighbour(std::size_t k) const noexcept { return static_cast<std::size_t>(neighbours[k]); }

    // Return the mean of the values of the neighbours of taxel i; 0 without neighbours.
    double mean_around(const Numbers& values, std::size_t i) const noexcept {
        double sum = 0;
        for (std::size_t k = begin(i); k < end(i); ++k) sum += values[neighbour(k)];
        return sum / static_cast<double>(std::max<std::size_t>(end(i) - begin(i), 1));
    }
};

// What the sums over the taxels weigh with.
struct Terms {
    using Sums = std::array<double, 12>;
    using Products = std::array<double, 10>;

    std::vector<Sums>
        rows; // wrench about the origin of the link; lift, lift x, lift y; f_z, tau_x, tau_y of the ground
    std::vector<SkinGeometry::LinkTerms> link;
    std::vector<Products>
        products;             // of ground terms: l, lx, ly with themselves, lx, ly with l; the same of f_z, tau_x, y
    bool has_moments = false; // whether they have the moments within the cells

    // Compute the products, which covariances of sums need.
    void multiply() {
        products.clear();
        for (const Sums& t : rows) products.push_back(products_of(t));
    }

    // Return the products of sums of the ground.
    static Products products_of(const Sums& t) noexcept {
        return {t[6] * t[6], t[7] * t[7],   t[8] * t[8],   t[7] * t[6],  t[8] * t[6],
                t[9] * t[9], t[10] * t[10], t[11] * t[11], t[10] * t[9], t[11] * t[9]};
    }
};

// The taxels that can stand on the ground, in the coordinates of the ground.
struct GroundGeometry {
    Plane plane;
    Booleans can_stand; // whether a taxel looks down
    std::size_t standing_count = 0;
    std::vector<Vec2> centres; // of the cells [m]
    Vec2 middle{};             // mean of the centres of those that can stand
    // Moments of the pressure gradient in the cells that `plain` leaves out, per force: lift x, lift y; about the link
    // [m]
    std::vector<std::array<double, 8>> gradient;
    Terms plain, full_contact, in_cell;
    HullTable centre_hull, sure_hull, corner_hull;
    Erosion erosion;

    GroundGeometry() = default;

    GroundGeometry(const SkinGeometry& skin, const Plane& ground) : plane(ground) {
        const Calibration& c = skin.calibration;
        const std::size_t n = skin.n;
        std::size_t each = 0;
        for (const auto& corners : c.corners) each = std::max(each, corners.size());
        std::vector<Vec2> flat_corners, offsets, all_corners;
        std::vector<std::vector<Vec2>> cells(n);
        plain.link = skin.terms;
        for (std::size_t i = 0; i < n; ++i) {
            const double downward = -dot(c.normals[i], plane.axes[2]);
            can_stand.push_back(downward >= min_downward);
            centres.push_back(plane.flat(c.positions[i]));
            for (std::size_t k = 0; k < each; ++k)
                all_corners.push_back(plane.flat(c.corners[i][std::min(k, c.corners[i].size() - 1)]));
            for (std::size_t k = 0; k < c.corners[i].size(); ++k) {
                const Vec2& corner = all_corners[i * each + k];
                cells[i].push_back({corner[0] - centres[i][0], corner[1] - centres[i][1]});
                if (can_stand[i]) offsets.push_back(cells[i].back());
            }
            const double lift = can_stand[i] ? downward : 0.0;
            lifts_.push_back(lift);
            pushes_.push_back(plane.along(plus({0, 0, 0}, c.normals[i], -1)));
            const Vec3 moment = cross(plane.along(plus(c.positions[i], plane.origin, -1)), pushes_[i]);
            Terms::Sums row{};
            std::copy(skin.terms[i].begin() + 5, skin.terms[i].end(), row.begin());
            const double own[] = {lift,     lift * centres[i][0], lift * centres[i][1], pushes_[i][2], moment[0],
                                  moment[1]};
            std::copy(std::begin(own), std::end(own), row.begin() + 6);
            plain.rows.push_back(row);
            standing_count += can_stand[i];
            for (std::size_t k = 0; k < 2; ++k) middle[k] += can_stand[i] ? centres[i][k] : 0.0;
        }
        for (double& x : middle) x /= static_cast<double>(std::max<std::size_t>(standing_count, 1));
        centre_hull = HullTable(centres, 1);
        sure_hull = HullTable(centres, 1);
        corner_hull = HullTable(all_corners, each);
        HullTable cell;
        cell.hull_of(offsets);
        erosion = Erosion(cell.hull.corners, n);
        full_contact = moved(full_contact_shifts(c, cells));
        in_cell = moved(arms_in_cells(skin, cells));
        for (std::size_t i = 0; i < n; ++i) {
            gradient.emplace_back();
            for (std::size_t k = 0; k < 8; ++k) {
                const std::size_t t = k < 2 ? 7 + k : k - 2;
                gradient[i][k] = in_cell.rows[i][t] - plain.rows[i][t];
            }
        }
        for (Terms* terms : {&plain, &full_contact, &in_cell}) terms->multiply();
    }

    // Return whether all taxels that can stand on the ground are active (n,).
    bool is_full(const Booleans& active) const noexcept {
        for (std::size_t i = 0; i < active.size(); ++i)
            if (can_stand[i] && !active[i]) return false;
        return standing_count > 0;
    }

private:
    static constexpr double min_downward = 0.5, max_moment_condition = 1e6, min_cell_spread = 1e-3;

    // Return the terms if each force acts away from the centre of its cell, by a shift (n, 2) [m].
    Terms moved(const std::vector<Vec2>& shift) const {
        Terms terms = plain;
        terms.has_moments = true;
        for (std::size_t i = 0; i < shift.size(); ++i) {
            const Vec3 moment = cross({shift[i][0], shift[i][1], 0}, pushes_[i]), in_link = plane.back(moment);
            for (std::size_t k = 0; k < 3; ++k) {
                terms.rows[i][3 + k] += in_link[k];
                terms.link[i][8 + k] += in_link[k];
            }
            for (std::size_t k = 0; k < 2; ++k) {
                terms.rows[i][7 + k] += lifts_[i] * shift[i][k];
                terms.rows[i][10 + k] += moment[k];
            }
        }
        return terms;
    }

    // Return the shifts (n, 2) that correct the CoP of a linear pressure on all taxels; zero for taxels in one row.
    std::vector<Vec2> full_contact_shifts(const Calibration& c, const std::vector<std::vector<Vec2>>& cells) const {
        const std::size_t n = centres.size();
        std::vector<Vec2> shift(n, Vec2{});
        double area = 0;
        Vec2 middle{};
        Mat2 spread{}, inside{};
        for (std::size_t i = 0; i < n; ++i)
            if (can_stand[i]) {
                area += c.areas[i];
                for (int k = 0; k < 2; ++k) middle[k] += c.areas[i] * centres[i][k];
            }
        if (standing_count < 3) return shift;
        middle = {middle[0] / area, middle[1] / area};
        for (std::size_t i = 0; i < n; ++i)
            if (can_stand[i]) {
                const Vec2 arm{centres[i][0] - middle[0], centres[i][1] - middle[1]};
                const Mat2 own = second_moments(cells[i]);
                for (int j = 0; j < 2; ++j)
                    for (int k = 0; k < 2; ++k) {
                        spread[j][k] += c.areas[i] * arm[j] * arm[k] / area;
                        inside[j][k] += c.areas[i] * own[j][k] / area;
                    }
            }
        const Eigen2 e(spread);
        if (!(e.large <= max_moment_condition * e.small)) return shift;
        const Mat2 gain = product(inside, pseudo_inverse(spread, 0.0));
        for (std::size_t i = 0; i < n; ++i)
            if (can_stand[i]) shift[i] = product(gain, Vec2{centres[i][0] - middle[0], centres[i][1] - middle[1]});
        return shift;
    }

    // Return by how much (n, 2) the force of each taxel acts away from its centre, for a pressure that varies [m].
    std::vector<Vec2> arms_in_cells(const SkinGeometry& skin, const std::vector<std::vector<Vec2>>& cells) const {
        const Numbers& areas = skin.calibration.areas;
        std::vector<Vec2> shift(skin.n, Vec2{});
        for (std::size_t i = 0; i < skin.n; ++i) {
            if (!can_stand[i]) continue;
            Mat2 normal{};
            const auto apart = [&](std::size_t j) {
                return can_stand[j] ? Vec2{centres[j][0] - centres[i][0], centres[j][1] - centres[i][1]} : Vec2{};
            };
            for (std::size_t k = skin.begin(i); k < skin.end(i); ++k) {
                const Vec2 d = apart(skin.neighbour(k));
                for (int a = 0; a < 2; ++a)
                    for (int b = 0; b < 2; ++b) normal[a][b] += d[a] * d[b];
            }
            const Mat2 gain = product(second_moments(cells[i]), pseudo_inverse(normal, min_cell_spread));
            for (std::size_t k = skin.begin(i); k < skin.end(i); ++k) {
                const std::size_t j = skin.neighbour(k);
                const Vec2 arm = product(gain, apart(j));
                for (int a = 0; a < 2; ++a) {
                    shift[j][a] += areas[i] * arm[a] / areas[j];
                    shift[i][a] -= areas[i] * arm[a] / areas[i];
                }
            }
        }
        return shift;
    }

    Numbers lifts_;            // fraction of a force that lifts the robot
    std::vector<Vec3> pushes_; // direction of the force on each taxel, along the axes of the ground
};

// Return the plane on which a flat skin stands, in its link frame; nothing if it is not flat.
inline std::optional<Plane> ground_of(const Calibration& c) {
    Vec3 sum{}, mean{}, middle{};
    for (std::size_t i = 0; i < c.areas.size(); ++i) sum = plus(sum, c.normals[i], c.areas[i]);
    const Vec3 down = unit(sum);
    double area = 0;
    for (std::size_t i = 0; i < c.areas.size(); ++i)
        if (dot(c.normals[i], down) >= 0.5) {
            area += c.areas[i];
            mean = plus(mean, c.normals[i], c.areas[i]);
            middle = plus(middle, c.positions[i], c.areas[i]);
        }
    if (area == 0 || std::sqrt(dot(mean, mean)) / area < 0.95) return std::nullopt;
    const Vec3 up = plus({0, 0, 0}, unit(mean), -1);
    const Vec3 forward = std::abs(up[0]) < 0.9 ? Vec3{1, 0, 0} : Vec3{0, 0, 1}; // the normal of a palm may be along x
    return Plane::through(plus({0, 0, 0}, middle, 1 / area), up, forward);
}

} // namespace skin_calib
