//! probe
use nalgebra::*;
use ramphold::{
    dataset,
    fit::*,
    signal::*,
    wrist::{Request, Response, Width, simulate},
};
fn main() {
    let path = std::env::args().nth(1).unwrap();
    let dir = std::path::Path::new(&path);
    let session = dataset::load(dir).unwrap();
    let name = dir.file_name().unwrap().to_str().unwrap();
    let truth: serde_json::Value = serde_json::from_str(
        &std::fs::read_to_string(dir.parent().unwrap().join(format!("truth/{name}.json"))).unwrap(),
    )
    .unwrap();
    for cutoff in [50.0, 100.0, 200.0, 400.0, 800.0] {
        let view = View {
            window_s: 0.04,
            filter: FilterSpec::Butterworth { order: 3, cutoff_hz: cutoff, zero_phase: false },
        };
        let prepared = Prepared::new(&session, view).unwrap();
        let mut lines = vec![];
        for (i, t) in prepared.trials.iter().enumerate() {
            let tr = truth["trials"]
                .as_array()
                .unwrap()
                .iter()
                .find(|x| x["trial"].as_u64() == Some(t.number as u64))
                .unwrap();
            let p: Vec<f64> =
                ramphold::wrist::BASE_PARAMETERS.iter().map(|n| tr[*n].as_f64().unwrap()).collect();
            let req = Request {
                lever: prepared.lever,
                kinds: &[],
                period_s: prepared.period_s,
                samples: prepared.samples,
                lead: prepared.lead,
                substeps: 2,
                filter: &prepared.sections,
                wanted: &[0, 1, 2, 3, 4, 5],
                width: Width::fastest(),
            };
            let mut r = Response::default();
            simulate(&req, &[&t.input], &p, &mut r);
            let mut j = DMatrix::from_row_slice(prepared.samples, 6, &r.slopes);
            for c in 0..6 {
                let s = p[c];
                j.column_mut(c).scale_mut(s);
            }
            let noise = &prepared.noises[prepared.noise_of[i].unwrap()];
            let c = &noise.covariance;
            let h = (j.transpose() * &j).try_inverse().unwrap();
            let cov = &h * (j.transpose() * c * &j) * &h;
            let ols: Vec<f64> = (0..6).map(|k| cov[(k, k)].sqrt()).collect();
            let gls = |m: usize| {
                let w = noise.whitener(m);
                let jw = &w * &j;
                let cov = (jw.transpose() * jw).try_inverse().unwrap();
                (0..6).map(|k| cov[(k, k)].sqrt()).collect::<Vec<f64>>()
            };
            let res: DVector<f64> =
                DVector::from_vec(r.torque_nm.clone()) - DVector::from_vec(t.measured_nm.clone());
            let w = noise.whitener(8);
            let z = &w * &res;
            let w2 = noise.whitener(30);
            let z2 = &w2 * &res;
            lines.push((
                ols,
                gls(8),
                gls(12),
                gls(30),
                vec![z.norm_squared() / 8.0, z2.norm_squared() / 30.0, res.norm() / 10.0, 0., 0., 0.],
            ));
        }
        let med = |f: &dyn Fn(&(Vec<f64>, Vec<f64>, Vec<f64>, Vec<f64>, Vec<f64>)) -> f64| {
            let mut v: Vec<f64> = lines.iter().map(f).collect();
            v.sort_by(f64::total_cmp);
            v[v.len() / 2]
        };
        println!("cutoff {cutoff}");
        for (n, g) in [("ols", 0), ("gls8", 1), ("gls12", 2), ("gls30", 3), ("chi8/8 chi30/30 rms", 4)] {
            let v: Vec<String> = (0..6)
                .map(|k| {
                    format!(
                        "{:.4}",
                        med(&|l| match g {
                            0 => l.0[k],
                            1 => l.1[k],
                            2 => l.2[k],
                            3 => l.3[k],
                            _ => l.4[k],
                        })
                    )
                })
                .collect();
            println!("  {n:6} {}", v.join(" "));
        }
    }
}
