// The localizer's filter with Eigen: an update by forty image lines of map edges, each projected anew at the current estimate, gated,
// and applied in Joseph's form.
//
// The benchmark `localize` of the map-localizer writes its problem to the temporary folder (yamabico-peers/line_update.raw, doubles):
// fx fy cx cy, the rotation camera_from_body by rows, the mount in the camera frame, x y theta of the prior and its two standard
// deviations, the gate, the number of edges, and for each edge its two ends on the map (x y z) and their two observed pixels (u v).
//
//   g++ -O3 -march=native -I EIGEN tests/peers/line_update_eigen.cpp -o line_update && ./line_update
#include <Eigen/Dense>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>
using Eigen::Matrix2d, Eigen::Matrix3d, Eigen::Vector2d, Eigen::Vector3d;
using Rows = Eigen::Matrix<double, 2, 3>;

struct Camera { double fx, fy, cx, cy; Matrix3d from_body; Vector3d mount; };
struct Line { Vector3d from, to; Vector2d observed[2]; };
struct Belief { Vector3d pose; Matrix3d covariance; };

struct View {
    const Camera &camera;
    Matrix3d from_map;
    Vector3d position;
    View(const Camera &c, const Vector3d &pose) : camera(c), position(pose.x(), pose.y(), 0) {
        const double s = std::sin(pose.z()), k = std::cos(pose.z());
        Matrix3d body;
        body << k, s, 0, -s, k, 0, 0, 0, 1;
        from_map.noalias() = c.from_body * body;
    }
    Vector3d pixel_line(const Vector3d &n) const {
        const double u = n.x() / camera.fx, v = n.y() / camera.fy;
        return {u, v, n.z() - camera.cx * u - camera.cy * v};
    }
    // Residual of both ends and its derivatives; false if the edge points at the camera.
    bool residual(const Line &line, Vector2d &r, Rows &h) const {
        const Vector3d p = line.from - position, q = line.to - position;
        const Vector3d a = from_map * p - camera.mount, b = from_map * q - camera.mount;
        const Vector3d l = pixel_line(a.cross(b));
        const double norm = l.head<2>().norm();
        if (!(norm > 1e-12 * (1 + a.norm() * b.norm()))) return false;
        const Vector3d run = b - a, unit = l / norm;
        const Vector3d turned_p = from_map * Vector3d(p.y(), -p.x(), 0), turned_q = from_map * Vector3d(q.y(), -q.x(), 0);
        Matrix3d j;
        j.col(0) = pixel_line((-from_map.col(0)).cross(run));
        j.col(1) = pixel_line((-from_map.col(1)).cross(run));
        j.col(2) = pixel_line(turned_p.cross(b) + a.cross(turned_q));
        j /= norm;
        j -= unit * (unit.head<2>().transpose() * j.topRows<2>());
        for (int i = 0; i < 2; ++i) {
            const Vector3d end(line.observed[i].x(), line.observed[i].y(), 1);
            r[i] = unit.dot(end);
            h.row(i) = end.transpose() * j;
        }
        return true;
    }
};

static int update(const Camera &camera, const std::vector<Line> &lines, double gate, Belief &belief) {
    int applied = 0;
    for (const Line &line : lines) {
        Vector2d r;
        Rows h;
        if (!View(camera, belief.pose).residual(line, r, h)) continue;
        const Eigen::Matrix<double, 3, 2> spread = belief.covariance * h.transpose();
        const Matrix2d inverse = (h * spread + Matrix2d::Identity()).inverse();
        if (!(r.dot(inverse * r) <= gate)) continue;
        const Eigen::Matrix<double, 3, 2> gain = spread * inverse;
        belief.pose -= gain * r;
        belief.pose.z() = std::remainder(belief.pose.z(), 2 * M_PI);
        const Matrix3d keep = Matrix3d::Identity() - gain * h;
        const Matrix3d covariance = keep * belief.covariance * keep.transpose() + gain * gain.transpose();
        belief.covariance = 0.5 * (covariance + covariance.transpose());
        ++applied;
    }
    return applied;
}

int main() {
    const char *data = std::getenv("PEERS_DATA"), *temporary = std::getenv("TMPDIR");
    const std::string folder = data ? data : std::string(temporary ? temporary : "/tmp") + "/yamabico-peers";
    const std::string path = folder + "/line_update.raw";
    std::ifstream file(path, std::ios::binary);
    std::vector<double> problem;
    for (double value; file.read(reinterpret_cast<char *>(&value), sizeof value);) problem.push_back(value);
    const double *n = problem.data();
    if (problem.size() < 23 || problem.size() != 23 + 10 * size_t(n[22])) {
        std::fprintf(stderr, "%s does not exist or is invalid: run the benchmark first\n", path.c_str());
        return 2;
    }
    using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
    Camera camera{n[0], n[1], n[2], n[3], Eigen::Map<const RowMajor>(n + 4), Eigen::Map<const Vector3d>(n + 13)};
    const Vector3d variances(n[19] * n[19], n[19] * n[19], n[20] * n[20]);
    const Belief prior{Eigen::Map<const Vector3d>(n + 16), variances.asDiagonal()};
    std::vector<Line> lines;
    for (const double *e = n + 23; e < n + problem.size(); e += 10) {
        const Vector2d first(e[6], e[7]), second(e[8], e[9]);
        lines.push_back({Vector3d(e[0], e[1], e[2]), Vector3d(e[3], e[4], e[5]), {first, second}});
    }
    Belief belief = prior;
    const int applied = update(camera, lines, n[21], belief);
    std::vector<double> us;
    for (int i = 0; i < 20000; ++i) {
        belief = prior;
        const auto from = std::chrono::steady_clock::now();
        update(camera, lines, n[21], belief);
        asm volatile("" : : "g"(&belief) : "memory");
        us.push_back(std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - from).count());
    }
    std::nth_element(us.begin(), us.begin() + us.size() / 2, us.end());
    const Vector3d &pose = belief.pose;
    std::printf("Eigen: %d of %zu edges, pose %.9f %.9f %.9f, median %.2f us\n", applied, lines.size(), pose.x(), pose.y(),
                pose.z(), us[us.size() / 2]);
}
