from p5_vp import *
import json,sys
K=os.path.join(os.environ.get('YAMABICO_DATA','../../../shared/data'),'york_urban','')
g=json.load(open(K+'ground_truth.json')); cam=g['camera']; f,cx,cy=cam['f_px'],cam['cx'],cam['cy']
def ray(p): v=np.array([(p[0]-cx)/f,(p[1]-cy)/f,1.]); return v/np.linalg.norm(v)
def ang(a,b): return np.degrees(np.arccos(min(1,abs(a@b))))
out={}
for i in g['images']:
    h=i.get('in_image_horizontal_vp')
    if h is None: continue
    im=cv2.imread(K+i['file'],0); gt=np.array(i['vp_dirs'][h['vp_index']]); gt/=np.linalg.norm(gt)
    for name,fn in (('FLD',seg_fld),('LSD',seg_lsd),('ED',seg_ed)):
        s,L=prep(fn(im))
        for m,e in (('ransac',ransac),('vote',vote)):
            p=e(s,L); er=ang(ray(p),gt) if np.isfinite(p[0]) else 90
            out.setdefault((name,m),[]).append((er,i['split_eccv08'],i['indoor'],i['corridor_like']))
for k,v in out.items():
    for lab,sel in (('all45',lambda r:True),('train',lambda r:r[1]=='train'),('test',lambda r:r[1]=='test'),('indoor',lambda r:r[2]),('corridor',lambda r:r[3])):
        e=np.array([r[0] for r in v if sel(r)])
        if len(e): print(k,lab,len(e),'med %.2f p90 %.2f  <=3deg %.0f%% <=5deg %.0f%%'%(np.median(e),np.percentile(e,90),100*(e<=3).mean(),100*(e<=5).mean()))
